"""Rows of the tables, made of the messages of a run in their order."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.batch.pictures import bgr_of
from ros_visualise.batch.tables import TABLES, Row, write_rows
from ros_visualise.core.errors import DamagedMessage, UsageError
from ros_visualise.data import (
    Detections,
    Detections3D,
    Floats,
    Hypothesis,
    Image,
    NavSatFix,
    Number,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
)
from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import content
from ros_visualise.sinks import Recorder
from ros_visualise.ui.live.trees import fields_of
from ros_visualise.vision.color import demosaiced, order_of, to_gray

if TYPE_CHECKING:
    import duckdb

_MOST_ROWS = 100_000  # of a table in memory
_NS = 1e-9
_KNOWN_M2 = 1e5  # with a larger variance, a position is only a direction


class Part(NamedTuple):
    """The part of a recording whose messages become rows, by their log time: from, and before."""

    begin_ns: float = -math.inf
    end_ns: float = math.inf


class FieldPattern(NamedTuple):
    """Numeric fields that are asked for: patterns of topic and path."""

    topic: str
    path: str


def parse_field(text: str) -> FieldPattern:
    """``/TOPIC.FIELD`` with wildcards.

    Raises:
        UsageError: another form.
    """
    topic, dot, path = text.partition(".")
    if not (topic.startswith(("/", "*")) and dot and path):
        raise UsageError(f"--fields {text}: give /TOPIC.FIELD, such as '/imu/data.*.x'")
    return FieldPattern(topic, path)


class RowRecorder(Recorder):
    """A recorder whose file is rows of `TABLES`.

    Args:
        graph: what runs.
        part: messages of other times only warm up the nodes.
        fields: numeric fields that become rows too.
        connection: writes the files.
        folder: of the files; it exists.
        pictures: keep the images in which something is detected, as JPEG files.

    Attributes:
        images: topics of images with statistics.
    """

    def __init__(
        self,
        graph: Graph,
        part: Part,
        fields: Sequence[FieldPattern],
        connection: duckdb.DuckDBPyConnection,
        folder: Path,
        pictures: bool = False,
    ) -> None:
        self._graph, self._part, self._folder = graph, part, folder
        self._connection, self._pictures = connection, pictures
        self._topics = {name: one for name, one in graph.topics.items() if not one.on_demand}
        self.images = {*_shown_images(graph)} & self._topics.keys()
        self._patterns = {
            name: [one.path for one in fields if fnmatchcase(name, one.topic)]
            for name in self._topics
        }
        self._rows: dict[str, list[Row]] = {table: [] for table in TABLES}
        self._parts: dict[str, int] = {}
        self._counts: dict[str, _Count] = {}
        self._maps: dict[str, list[Row]] = {}
        self._image: dict[int, Image] = {}

    @property
    def path(self) -> Path:
        """The folder of the tables."""
        return self._folder

    @property
    def topics(self) -> tuple[str, ...]:
        """All topics but those on demand."""
        return tuple(self._topics)

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """Make rows of a message, if it belongs to the part."""
        if stamp_ns is None or not self._part.begin_ns <= stamp_ns < self._part.end_ns:
            return
        t_ns = message.header.stamp_ns
        self._counts.setdefault(topic, _Count()).add(t_ns)
        publisher = self._topics[topic].publisher
        made = t_ns, publisher, topic
        kind = self._topics[topic].type
        if kind is Image and topic not in self.images:
            return
        make = _MAKERS.get(kind)
        if make is not None:
            table, found = make(content(message))
            rows = [(*made, *row) for row in found]
            if table == "landmarks":  # each message has all
                self._maps[topic] = rows
            else:
                self._add(table, rows)
        if self._patterns[topic]:
            self._add("fields", [(*made, *row) for row in self._fields(topic, message)])
        if self._pictures:
            self._keep_picture(topic, content(message) if make else message)

    def add_row(self, table: str, row: Row) -> None:
        """Add a row of another kind."""
        self._add(table, [row])

    def messages(self, node: str) -> int:
        """Messages of a node in the part."""
        published = [name for name, one in self._topics.items() if one.publisher == node]
        return sum(self._counts[name].messages for name in published if name in self._counts)

    def close(self, whole: bool = True) -> None:
        """Write what is left at the end of the run, but for the rows that are added after it."""

    def finish(self) -> None:
        """Write all rows that wait."""
        for rows in self._maps.values():
            self._add("landmarks", rows)
        self._maps.clear()
        for name, count in self._counts.items():
            topic = self._topics[name]
            self._add("topics", [(name, topic.ros.name, topic.publisher, *count.row())])
        for table in TABLES:
            self._flush(table)

    def remove(self) -> None:
        """Do nothing: the folder belongs to the task."""

    def _fields(self, topic: str, message: Any) -> Iterator[tuple[str, float]]:
        for path, value in fields_of(message).items():
            if any(fnmatchcase(path, wanted) for wanted in self._patterns[topic]):
                yield path, value

    def _add(self, table: str, rows: list[Row]) -> None:
        self._rows[table] += rows
        if len(self._rows[table]) >= _MOST_ROWS:
            self._flush(table)

    def _flush(self, table: str) -> None:
        rows = self._rows[table]
        if not rows:
            return
        number = self._parts.get(table, 0)
        path = self._folder / f"{table}.{number:04d}.parquet"
        write_rows(self._connection, table, rows, path)
        self._parts[table] = number + 1
        self._rows[table] = []

    def _keep_picture(self, topic: str, message: Any) -> None:
        if isinstance(message, Image) and topic in self.images:
            self._image = {message.header.stamp_ns: message}
        elif isinstance(message, Detections) and message.detections:
            stamp_ns = message.header.stamp_ns
            image = self._image.pop(stamp_ns, None)
            if image is not None:
                _write_picture(image, self._folder / "pictures" / f"{stamp_ns}.jpg")


class _Count:
    """Counts the messages of a topic, and measures the gaps between them."""

    def __init__(self) -> None:
        self.messages = 0
        self._first_ns = self._last_ns = self._gap_ns = self._before_gap_ns = 0

    def add(self, stamp_ns: int) -> None:
        if self.messages:
            if stamp_ns - self._last_ns > self._gap_ns:
                self._gap_ns, self._before_gap_ns = stamp_ns - self._last_ns, self._last_ns
        else:
            self._first_ns = stamp_ns
        self._last_ns = stamp_ns
        self.messages += 1

    def row(self) -> Row:
        gap = self._gap_ns * _NS, self._before_gap_ns
        return self.messages, self._first_ns, self._last_ns, *gap


def _write_picture(image: Image, path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(path), bgr_of(image))


def _shown_images(graph: Graph) -> Iterator[str]:
    """The images of the nodes, and the source's that they are made from; else its first."""
    taken = {topic for node in graph.nodes for topic in node.inputs.values()}
    published = graph.topics_of(Image)
    own = graph.topics_of(Image, *(node.name for node in graph.nodes))
    of_source = [topic for topic in published if topic not in own]
    yield from own
    yield from [topic for topic in of_source if topic in taken] or of_source[:1]


def _of_detections(message: Detections) -> tuple[str, Iterator[Row]]:
    def rows() -> Iterator[Row]:
        for one in message.detections:
            low, high = one.outline_uv.min(axis=0), one.outline_uv.max(axis=0)
            point = one.center_uv if one.point_uv is None else one.point_uv
            yield (
                *(message.header.frame_id, one.class_id, one.id, one.score),
                *(*low.tolist(), *(high - low).tolist(), *point.tolist()),
                *_pose_of(one.best),
            )

    return "detections", rows()


def _of_landmarks(message: Detections3D) -> tuple[str, Iterator[Row]]:
    def rows() -> Iterator[Row]:
        for one in message.detections:
            yield (message.header.frame_id, one.id or one.class_id, *_pose_of(one.best))

    return "landmarks", rows()


def _pose_of(one: Hypothesis) -> Row:
    """Pose and covariance; None if unknown, or a direction only."""
    if not (one.covariance.any() or one.position_xyz.any()):
        return (None,) * 8
    if np.linalg.eigvalsh(one.covariance[:3, :3])[-1] >= _KNOWN_M2:
        return (None,) * 8
    return (*one.position_xyz.tolist(), *one.quat_xyzw.tolist(), _known(one.covariance))


def _known(covariance: Floats) -> Floats | None:
    return covariance if covariance.any() else None


def _of_pose(message: Any) -> tuple[str, Sequence[Row]]:
    covariance = getattr(message, "pose_covariance", getattr(message, "covariance", None))
    velocity = getattr(message, "linear_xyz", None)
    row = (
        message.header.frame_id,
        getattr(message, "child_frame_id", ""),
        *message.position_xyz.tolist(),
        *message.quat_xyzw.tolist(),
        None if covariance is None else _known(covariance),
        *((None,) * 3 if velocity is None else velocity.tolist()),
    )
    return "poses", [row]


def _of_fix(message: NavSatFix) -> tuple[str, Sequence[Row]]:
    place = message.latitude, message.longitude, message.altitude
    return "fixes", [(*place, message.status, _known(message.covariance))]


def _of_number(message: Number) -> tuple[str, Sequence[Row]]:
    return "fields", [("data", message.number)]


def _of_image(message: Image) -> tuple[str, Sequence[Row]]:
    try:
        luma = to_gray(demosaiced(message.pixels, message.encoding), order_of(message.encoding))
    except (DamagedMessage, cv2.error):
        luma = np.zeros((0, 0), np.uint8)
    if luma.dtype == np.uint16:
        luma = (luma >> 8).astype(np.uint8)
    size = message.width, message.height
    if luma.dtype != np.uint8 or not luma.size:  # measurements, such as depth
        return "image_stats", [(*size, *(None,) * 5)]
    mean, deviation = (float(one[0, 0]) for one in cv2.meanStdDev(luma))
    edges = cv2.Laplacian(luma, cv2.CV_16S)
    sharpness = float(cv2.meanStdDev(edges)[1][0, 0]) ** 2
    dark, bright = (np.count_nonzero(luma == level) / luma.size for level in (0, 255))
    return "image_stats", [(*size, mean / 255, deviation / 255, sharpness, dark, bright)]


_MAKERS: dict[type, Callable[[Any], tuple[str, Any]]] = {
    Detections: _of_detections,
    Detections3D: _of_landmarks,
    PoseStamped: _of_pose,
    PoseWithCovarianceStamped: _of_pose,
    Odometry: _of_pose,
    NavSatFix: _of_fix,
    Image: _of_image,
    Number: _of_number,
}
"""Class of messages -> the table and the rows of one, after those of every message."""
