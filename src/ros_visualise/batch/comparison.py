"""Differences between the results of two batches, recording by recording and topic by topic.

Runs are repeatable: results of the same work differ only in the time that it took.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.batch.results import Results
from ros_visualise.batch.tables import quoted
from ros_visualise.geometry import se3
from ros_visualise.geometry.trajectory_errors import absolute_errors, associate, nees, pose_error

Arrays = Mapping[str, npt.NDArray[Any]]

METRICS: Mapping[str, str] = {
    "recordings": "1 for a recording that is in only one of the two results",
    "failures": "new failures of a recording",
    "messages": "difference in the number of messages on a topic",
    "rate": "relative difference in the rate of a topic",
    "gap_s": "difference in the longest gap of a topic, seconds",
    "lost": "lost detections: no detection of the same class in the same place",
    "gained": "new detections",
    "moved": "1 minus the mean overlap (IoU) of the matched detections",
    "position_m": "rms distance between corresponding poses",
    "rotation_deg": "rms angle between corresponding poses",
    "ate_m": "increase in the rms distance from the truth",
    "nees": "increase in the mean NEES against the truth",
    "images": "mean relative difference in brightness, contrast and sharpness",
    "fields": "largest difference in numeric fields",
    "cpu": "ratio of CPU times",
    "step": "ratio of the median durations of a node's step",
    "p99": "ratio of the 99th percentiles of a node's latency",
}
"""Metric -> the number that is compared with its limit."""

RATIOS = ("cpu", "step", "p99")
"""Metrics of times, which no two runs have in common; without a limit they are only shown."""

_IOU = 0.5
_SLIGHT = 1e-9  # of rounding


class ResultChange(NamedTuple):
    """A difference: the number before and after, what is held against a limit, and where.

    ``of`` is the topic or the node, ``at_ns`` the stamp of the worst moment, if there is one.
    """

    recording: str
    of: str
    metric: str
    before: float | None
    after: float | None
    change: float
    at_ns: int | None = None


class FrameBoxes(NamedTuple):
    """Detections of one image: classes, and boxes (N, 4) of left, top, width, height."""

    labels: Sequence[str]
    boxes: npt.NDArray[np.float64]


class ResultComparison:
    """The results of two batches, open to be compared; close it.

    Args:
        before, after: their folders.
        truth: topic of true poses, where there are any.
        slop_s: longest time between messages that belong together.

    Raises:
        OpenError: one is not the results of a batch.
    """

    def __init__(self, before: Path, after: Path, truth: str, slop_s: float) -> None:
        self._truth, self._slop_ns = truth, round(slop_s * 1e9)
        self.sql = Results(before).open_tables(suffix="_0")
        with closing(Results(after).open_tables()):
            pass
        tables = {path.stem: quoted(path) for path in sorted(after.glob("*.parquet"))}
        # of another folder, recordings have other names: their content tells
        self.sql.execute(
            "CREATE TABLE names AS SELECT a.recording AS own, min(b.recording) AS recording"
            f" FROM read_parquet({tables['recordings']}) a JOIN recordings_0 b USING (content)"
            " WHERE content != '' AND a.recording NOT IN (SELECT recording FROM recordings_0)"
            " GROUP BY own"
        )
        for name, path in tables.items():
            self.sql.execute(
                f"CREATE VIEW {name} AS SELECT coalesce(names.recording, one.recording) AS"
                f" recording, one.* EXCLUDE (recording) FROM read_parquet({path}) one"
                " LEFT JOIN names ON own = one.recording"
            )

    def close(self) -> None:
        """Close the tables."""
        self.sql.close()

    def changes(self) -> list[ResultChange]:
        """All differences; those of times for all recordings, others only where they are."""
        found = [
            ResultChange(*row) for query in _QUERIES for row in self.sql.execute(query).fetchall()
        ]
        for recording, topic in self._differing("detections", "label, left_px, top_px, width_px"):
            found += self._detections(recording, topic)
        for recording, topic in self._differing("poses", "x, y, z, qx, qy, qz, qw, covariance"):
            found += self._poses(recording, topic)
        return [one for one in found if abs(one.change) > _SLIGHT or one.metric in RATIOS]

    def detected(self, recording: str, topic: str, at_ns: int) -> tuple[FrameBoxes, FrameBoxes]:
        """The detections about a time, before and after."""
        sides = []
        for table in ("detections_0", "detections"):
            frames = frames_of(self._rows(table, recording, topic))
            near = [t for t in frames if abs(t - at_ns) <= self._slop_ns]
            nearest = min(near, key=lambda t: abs(t - at_ns), default=None)
            sides.append(_NOTHING if nearest is None else frames[nearest])
        return sides[0], sides[1]

    def recordings(self) -> list[str]:
        """Names of all recordings of both."""
        query = (
            "SELECT recording FROM recordings UNION SELECT recording FROM recordings_0 ORDER BY 1"
        )
        return sorted(name for (name,) in self.sql.execute(query).fetchall())

    def origin(self, recording: str, topic: str) -> tuple[str, list[str]]:
        """The file of a recording, and the topics that one of its topics is made from."""
        query = (
            "SELECT path, inputs FROM recordings LEFT JOIN nodes USING (recording) LEFT JOIN topics"
            " USING (recording, node) WHERE recording = ? AND topic = ? UNION ALL"
            " SELECT path, '' FROM recordings_0 WHERE recording = ?"
        )
        path, inputs = self.sql.execute(query, [recording, topic, recording]).fetchall()[0]
        return path, inputs.split(",")

    def _differing(self, table: str, columns: str) -> list[tuple[str, str]]:
        """Recordings and topics that are in both results, with different rows."""
        digest = f"bit_xor(hash(t_ns, {columns})), count(*)"
        grouped = f"SELECT recording, topic, {digest} FROM {{}} GROUP BY ALL"
        query = (
            "SELECT DISTINCT recording, topic FROM ("
            f"({grouped.format(table)} EXCEPT {grouped.format(table + '_0')}) UNION ALL"
            f" ({grouped.format(table + '_0')} EXCEPT {grouped.format(table)}))"
            " WHERE recording IN (FROM (SELECT recording FROM recordings"
            " SEMI JOIN recordings_0 USING (recording))) ORDER BY ALL"
        )
        return self.sql.execute(query).fetchall()

    def _rows(self, table: str, recording: str, topic: str) -> Arrays:
        query = f"SELECT * FROM {table} WHERE recording = ? AND topic = ? ORDER BY t_ns"
        return self.sql.execute(query, [recording, topic]).fetchnumpy()

    def _detections(self, recording: str, topic: str) -> Iterator[ResultChange]:
        sides = [
            frames_of(self._rows(table, recording, topic))
            for table in ("detections_0", "detections")
        ]
        times = [np.array(list(side), np.int64) for side in sides]
        lost, gained, overlaps = {}, {}, []
        pairs: list[tuple[int, int]] = []
        if len(times[0]) and len(times[1]):
            at = associate(times[0], times[1], self._slop_ns)
            pairs = list(zip(times[0][at[0]].tolist(), times[1][at[1]].tolist(), strict=True))
        paired = [{one[side] for one in pairs} for side in (0, 1)]
        lost = {t: len(one.labels) for t, one in sides[0].items() if t not in paired[0]}
        gained = {t: len(one.labels) for t, one in sides[1].items() if t not in paired[1]}
        for before_ns, after_ns in pairs:
            before, after = sides[0][before_ns], sides[1][after_ns]
            found = match(before, after)
            overlaps += found
            lost[before_ns] = len(before.labels) - len(found)
            gained[before_ns] = len(after.labels) - len(found)
        before_n, after_n = (sum(len(one.labels) for one in side.values()) for side in sides)
        for metric, several in (("lost", lost), ("gained", gained)):
            worst = max(several, key=lambda t: several[t], default=None)
            yield ResultChange(
                recording, topic, metric, before_n, after_n, sum(several.values()), worst
            )
        moved = 1 - float(np.mean(overlaps)) if overlaps else 0.0
        yield ResultChange(recording, topic, "moved", None, None, moved)

    def _poses(self, recording: str, topic: str) -> Iterator[ResultChange]:
        sides = [_Track(self._rows(table, recording, topic)) for table in ("poses_0", "poses")]
        if not len(sides[0].stamps_ns) or not len(sides[1].stamps_ns):
            return  # the messages differ
        first, second = associate(sides[0].stamps_ns, sides[1].stamps_ns, self._slop_ns)
        if len(first):
            errors = absolute_errors(sides[0].T[first], sides[1].T[second])
            for metric, each in (
                ("position_m", errors.translation_m),
                ("rotation_deg", errors.rotation_deg),
            ):
                worst = int(sides[0].stamps_ns[first[int(np.argmax(each))]])
                yield ResultChange(recording, topic, metric, None, None, _rms(each), worst)
        if topic == self._truth:
            return
        true = [_Track(self._rows(table, recording, self._truth)) for table in ("poses_0", "poses")]
        scores = [one.score(truth, self._slop_ns) for one, truth in zip(sides, true, strict=True)]
        for number, metric in enumerate(("ate_m", "nees")):
            before, after = (one[number] for one in scores)
            if before is not None and after is not None:
                yield ResultChange(
                    recording, topic, metric, before, after, max(0.0, after - before)
                )


class _Track:
    """Poses of a topic: stamps (N,), matrices (N, 4, 4), and covariances, None where unknown."""

    def __init__(self, rows: Arrays) -> None:
        self.stamps_ns = np.asarray(rows["t_ns"], np.int64)
        self._xyz = np.stack([np.asarray(rows[name], np.float64) for name in "xyz"], axis=1)
        names = ("qx", "qy", "qz", "qw")
        self._quats = np.stack([np.asarray(rows[name], np.float64) for name in names], axis=1)
        self._covariances = rows["covariance"]
        self.T = se3.from_pose(self._xyz, self._quats)

    def score(self, truth: _Track, slop_ns: int) -> tuple[float | None, float | None]:
        """Rms distance from the truth, and mean NEES; None where unknown."""
        if not len(truth.stamps_ns):
            return None, None
        own, other = associate(self.stamps_ns, truth.stamps_ns, slop_ns)
        if not len(own):
            return None, None
        ate = _rms(np.linalg.norm(self._xyz[own] - truth._xyz[other], axis=1))
        found = []
        for mine, theirs in zip(own, other, strict=True):
            covariance = self._covariances[mine]
            if covariance is None or covariance is np.ma.masked:
                continue
            error = pose_error(
                self._xyz[mine], self._quats[mine], truth._xyz[theirs], truth._quats[theirs]
            )
            value = nees(error, np.reshape(np.asarray(covariance, np.float64), (6, 6)))
            found += [] if value is None else [value]
        return ate, float(np.mean(found)) if found else None


_NOTHING = FrameBoxes([], np.zeros((0, 4)))


def match(before: FrameBoxes, after: FrameBoxes) -> list[float]:
    """Overlaps (IoU) of detections of one class in the same place, each once, the best first."""
    pairs = [
        (iou(before.boxes[i], after.boxes[j]), i, j)
        for i, label in enumerate(before.labels)
        for j, other in enumerate(after.labels)
        if label == other
    ]
    found, taken = [], (set[int](), set[int]())
    for overlap, i, j in sorted(pairs, reverse=True):
        if overlap >= _IOU and i not in taken[0] and j not in taken[1]:
            taken[0].add(i)
            taken[1].add(j)
            found.append(overlap)
    return found


def iou(one: npt.NDArray[np.float64], other: npt.NDArray[np.float64]) -> float:
    """Overlap of two boxes: the area in both, of that in any."""
    low, high = np.maximum(one[:2], other[:2]), np.minimum(one[:2] + one[2:], other[:2] + other[2:])
    both = float(np.prod(np.clip(high - low, 0, None)))
    area = float(np.prod(one[2:]) + np.prod(other[2:])) - both
    return both / area if area > 0 else 1.0


def frames_of(rows: Arrays) -> dict[int, FrameBoxes]:
    """Stamp -> the detections at that time."""
    stamps = np.asarray(rows["t_ns"], np.int64)
    names = ("left_px", "top_px", "width_px", "height_px")
    boxes = np.stack([np.ma.filled(rows[name], 0.0).astype(np.float64) for name in names], axis=1)
    begins = np.flatnonzero(np.diff(stamps, prepend=stamps[:1] - 1))
    ends = [*begins[1:], len(stamps)][: len(begins)]
    return {
        int(stamps[begin]): FrameBoxes(list(rows["label"][begin:end]), boxes[begin:end])
        for begin, end in zip(begins, ends, strict=True)
    }


def _rms(values: npt.NDArray[Any]) -> float:
    return math.sqrt(float(np.mean(values**2)))


_BOTH = "recording IN (SELECT recording FROM recordings SEMI JOIN recordings_0 USING (recording))"
_RELATIVE = "abs(a.{0} - b.{0}) / greatest(abs(a.{0}), abs(b.{0}), 1e-9)"


def _ratio(metric: str, table: str, of: str, column: str) -> str:
    grouped = f"SELECT recording, {of} AS of, sum({column}) AS n FROM {{}} GROUP BY ALL"
    return (
        f"SELECT recording, of, '{metric}', b.n, a.n, a.n / b.n, NULL"
        f" FROM ({grouped.format(table)}) a JOIN ({grouped.format(table + '_0')}) b"
        " USING (recording, of) WHERE a.n > 0 AND b.n > 0 ORDER BY ALL"
    )


def _of_topics(metric: str, value: str, change: str) -> str:
    grouped = f"SELECT recording, topic, {value} AS n FROM {{}} WHERE {_BOTH} GROUP BY ALL"
    return (
        f"SELECT recording, topic, '{metric}', b.n, a.n, {change.format('n')}, NULL"
        f" FROM ({grouped.format('topics')}) a FULL JOIN ({grouped.format('topics_0')}) b"
        " USING (recording, topic) ORDER BY ALL"
    )


_PIXELS = " + ".join(_RELATIVE.format(one) for one in ("brightness", "contrast", "sharpness"))
_QUERIES = (
    "SELECT recording, '', 'recordings', count(b.path), count(a.path),"
    " abs(count(a.path) - count(b.path)), NULL"
    " FROM recordings a FULL JOIN recordings_0 b USING (recording) GROUP BY recording ORDER BY ALL",
    "SELECT recording, '', 'failures', any_value(b.n), any_value(a.n),"
    " greatest(0, coalesce(any_value(a.n), 0) - coalesce(any_value(b.n), 0)), NULL"
    " FROM (SELECT recording, count(*) AS n FROM failures GROUP BY ALL) a FULL JOIN"
    " (SELECT recording, count(*) AS n FROM failures_0 GROUP BY ALL) b USING (recording)"
    " GROUP BY recording ORDER BY ALL",
    _of_topics("messages", "sum(messages)", "abs(coalesce(a.{0}, 0) - coalesce(b.{0}, 0))"),
    _of_topics(
        "rate",
        "(sum(messages) - 1) * 1e9 / nullif(max(last_ns) - min(first_ns), 0)",
        f"coalesce({_RELATIVE}, 0)",
    ),
    _of_topics("gap_s", "max(max_gap_s)", "coalesce(abs(a.{0} - b.{0}), 0)"),
    f"SELECT recording, topic, 'images', avg(b.sharpness), avg(a.sharpness),"
    f" coalesce(avg({_PIXELS}) / 3, 0), arg_max(t_ns, {_PIXELS})"
    " FROM image_stats a JOIN image_stats_0 b USING (recording, topic, t_ns)"
    " GROUP BY recording, topic ORDER BY ALL",
    "SELECT recording, topic || '.' || field, 'fields', avg(b.value), avg(a.value),"
    " coalesce(max(abs(a.value - b.value)), 0), arg_max(t_ns, abs(a.value - b.value))"
    " FROM fields a JOIN fields_0 b USING (recording, topic, field, t_ns)"
    " GROUP BY recording, topic, field ORDER BY ALL",
    _ratio("cpu", "segments", "''", "cpu_s"),
    _ratio("step", "nodes", "node", "step_ms"),
    _ratio("p99", "nodes", "node", "p99_ms"),
)
