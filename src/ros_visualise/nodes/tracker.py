"""The node that gives all detections of one object the same id."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from ros_visualise.core.errors import NoTransform, ParameterError
from ros_visualise.core.params import param
from ros_visualise.data import (
    CameraInfo,
    Deferred,
    Detection,
    Detections,
    DiagnosticArray,
    DiagnosticStatus,
    Floats,
    Header,
    Image,
    MarkerArray,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.landmarks.networks.finding import GroundPoint
from ros_visualise.landmarks.tracking.borders import clipped, in_view
from ros_visualise.landmarks.tracking.camera_motion import ImageMotion, ground_motion
from ros_visualise.landmarks.tracking.counting import CountingLine, CountingZone, parse_shapes
from ros_visualise.landmarks.tracking.drawing import draw_tracks, ground_markers, on_ground
from ros_visualise.landmarks.tracking.tracker import STILL, ByteTracker, TrackingRules
from ros_visualise.landmarks.tracking.tracks import Numbers
from ros_visualise.nodes import Exact, node
from ros_visualise.vision import color

_MARKERS_NS = 100_000_000
_MARKER = 0.02  # size, of the camera's height
_TRAIL = 100  # points


class CameraMotion(Enum):
    """Way in which the motion of the camera is found."""

    AUTO = "auto"
    ODOMETRY = "odometry"
    IMAGE = "image"
    NONE = "none"


@dataclass(frozen=True)
class TrackerParams:
    """Parameters of `tracker`."""

    high_score: float = param(
        0.5,
        "minimum score, 0 to 1, for a detection to count fully towards a new track; scores down to"
        " the mean of high_score and low_score count less, and lower ones do not count",
        min=0,
        max=1,
    )
    low_score: float = param(
        0.1,
        "minimum score for a detection to continue a track; the detector's own minimum score should"
        " not be higher",
        min=0,
        max=1,
    )
    patience: float = param(
        3.0,
        "time after which an object that is no longer detected loses its id, seconds",
        min=0,
        max=600,
        slider=(0, 10),
    )
    coast: float = param(
        0.4,
        "time for which an object that is no longer detected is still published, at its"
        " predicted place, seconds",
        min=0,
        max=60,
        slider=(0, 2),
    )
    confirmations: int = param(
        2, "number of detections in successive images before an object gets an id", min=1, max=100
    )
    camera_motion: CameraMotion = param(
        CameraMotion.AUTO,
        "source of the camera's motion: odometry (tf and calibration), the image, none (the camera"
        " does not move), or auto: odometry if available, else the image",
    )
    lines: str = param(
        "",
        "counting lines, in pixels, such as 'gate: 100,200 400,200', separated by semicolons;"
        " 'in' counts crossings from left to right, looking from the first point to the second",
    )
    zones: str = param(
        "",
        "counting zones, in pixels, such as 'yard: 0,0 100,0 100,100', separated by semicolons",
    )
    stands_on: GroundPoint = param(
        GroundPoint.BOTTOM,
        "point of a box that stands on the ground and is counted: the middle of its lower side, or"
        " its centre, for a view from above",
    )
    min_overlap: float = param(
        0.2,
        "minimum overlap of a track with its next detection (intersection over union), both"
        " enlarged by the uncertainty of the prediction",
        min=0.01,
        max=0.99,
        group="association",
    )
    min_low_overlap: float = param(
        0.5,
        "minimum overlap of a track with a detection that has a low score",
        min=0.01,
        max=0.99,
        group="association",
    )
    acceleration: float = param(
        0.25,
        "standard deviation of the change in an object's velocity in one second, in box lengths"
        " per second",
        min=0.01,
        max=100,
        slider=(0.05, 5),
        group="association",
    )
    same_class: bool = param(
        False, "match detections only with tracks of the same class", group="association"
    )
    fixed_frame: str = param("odom", "frame in which the ground is still", group="ground")
    ground_height: float = param(
        0.0,
        "height of the ground in fixed_frame, metres",
        min=-1e4,
        max=1e4,
        slider=(-10, 10),
        group="ground",
    )

    def __post_init__(self) -> None:
        parse_shapes(self.lines, "lines", 2, 2)
        parse_shapes(self.zones, "zones", 3, 1000)
        if self.low_score > self.high_score:
            raise ParameterError(
                f"low_score={self.low_score:g} is above high_score={self.high_score:g}"
            )

    @property
    def rules(self) -> TrackingRules:
        """The rules of association."""
        return TrackingRules(
            self.high_score,
            self.low_score,
            self.min_overlap,
            self.min_low_overlap,
            self.confirmations,
            self.patience,
            self.acceleration,
            self.same_class,
        )

    @property
    def shapes(self) -> list[CountingLine | CountingZone]:
        """Lines and zones, without counts."""
        lines = parse_shapes(self.lines, "lines", 2, 2).items()
        zones = parse_shapes(self.zones, "zones", 3, 1000).items()
        return [*(CountingLine(*one) for one in lines), *(CountingZone(*one) for one in zones)]


@node(
    "tracker",
    params=TrackerParams,
    inputs={"detections": Detections, "image": Image},
    outputs={
        "tracks": Detections,
        "debug_image": Image,
        "markers": MarkerArray,
        "counts": DiagnosticArray,
    },
    on_demand=("debug_image", "markers"),
    latched=("counts",),
    topics={
        "tracks": "/tracks",
        "debug_image": "/tracks_image",
        "markers": "/track_markers",
        "counts": "/counts",
    },
    sync=Exact(),
    frames=True,
    calibrated=True,
    splittable=False,
)
class Tracker:
    """Gives detections of the same object the same id, and counts objects at lines and in zones.

    ``tracks`` has the detections of each image that belong to an object, with its id. ``markers``
    shows the objects on the ground, if the pose of the camera is known.
    """

    def __init__(self, params: TrackerParams) -> None:
        self._tracker, self._motion = ByteTracker(), ImageMotion()
        self._classes: dict[str, int] = {}
        self._stamp_ns: int | None = None
        self._pose: Floats | None = None  # of the camera at the last image
        self._late = 0
        self._last: dict[str, Detection] = {}  # detection of each track
        self._trails: dict[int, deque[Floats]] = {}  # in the fixed frame
        self._marked_ns = 0
        self._params, self._shapes = params, params.shapes
        self._counts: dict[str, dict[str, int]] = {}

    def reset(self) -> None:
        """Start over: time jumped. Counts stay."""
        self._tracker.forget()
        self._motion.forget()
        self._stamp_ns = self._pose = None
        self._last, self._trails = {}, {}

    def step(
        self,
        detections: Detections,
        params: TrackerParams,
        frames: FrameTree,
        image: Image | None = None,
    ) -> dict[str, Any] | None:
        """The detections of an image that belong to an object."""
        if params is not self._params:
            self._prepare(params)
        stamp_ns = detections.header.stamp_ns
        if self._stamp_ns is not None and stamp_ns < self._stamp_ns:
            self._late += 1
            return None
        elapsed_ns = 0 if self._stamp_ns is None else stamp_ns - self._stamp_ns
        usable, boxes = _usable(detections)
        scores = np.array([one.score if one.hypotheses else 1.0 for one in usable])
        numbers = [self._classes.setdefault(one.class_id, len(self._classes)) for one in usable]
        info = detections.camera_info or (image.camera_info if image else None)
        H = self._camera_motion(detections.header, image, info, params, frames)
        self._stamp_ns = stamp_ns
        size = _size(info or image, boxes)
        ids = self._tracker.step(
            elapsed_ns, boxes, scores, np.array(numbers, np.int64), params.rules, H, size
        )
        seen = [one.identified(str(id)) for one, id in zip(usable, ids.tolist(), strict=True) if id]
        self._remember(seen)
        found = replace(detections, detections=(*seen, *self._coasting(size, params)))
        return {
            "tracks": found,
            "counts": self._count(boxes[ids > 0], ids[ids > 0], detections.header),
            "debug_image": None if image is None else self._drawn(image, found),
            "markers": self._markers(found.header, info, params),
        }

    def report(self) -> dict[str, Any]:
        """Numbers of tracks, of images out of order, and of those without a known motion."""
        return {
            "tracks": self._tracker.begun,
            "late": self._late,
            "unknown_motion": self._motion.unknown,
        }

    def _prepare(self, params: TrackerParams) -> None:
        """Apply parameters; lines and zones that changed start with new counts."""
        if (params.lines, params.zones) != (self._params.lines, self._params.zones):
            self._shapes, self._counts = params.shapes, {}
        self._params = params

    def _remember(self, seen: list[Detection]) -> None:
        """Keep the last detection of each track."""
        known = set(map(str, self._tracker.tracks.ids.tolist()))
        kept = {id: one for id, one in self._last.items() if id in known}
        self._last = {**kept, **{one.id: one for one in seen}}

    def _coasting(self, size: tuple[int, int] | None, params: TrackerParams) -> Iterator[Detection]:
        """Objects that were detected shortly before, where they are expected in the image."""
        tracks = self._tracker.tracks
        waited_ns = self._tracker.now_ns - tracks.seen_ns
        is_due = (tracks.ids > 0) & (waited_ns > 0) & (waited_ns <= params.coast * 1e9)
        if size is not None:
            is_due &= in_view(tracks.boxes, size)
        boxes = tracks.boxes[is_due] if size is None else clipped(tracks.boxes[is_due], size)
        for id, box in zip(tracks.ids[is_due].tolist(), boxes, strict=True):
            last = self._last[str(id)]
            yield Detection(box[:2], box[2:], hypotheses=last.hypotheses, id=last.id)

    def _camera_motion(
        self,
        header: Header,
        image: Image | None,
        info: CameraInfo | None,
        params: TrackerParams,
        frames: FrameTree,
    ) -> Floats | None:
        """Motion of pixels since the last image; None if it is unknown.

        Raises:
            NoTransform: the pose is unknown, and the parameter asks for it.
        """
        former, self._pose = self._pose, self._pose_at(header, params, frames)
        if params.camera_motion is CameraMotion.NONE:
            return STILL
        if info is not None and self._pose is not None:
            self._motion.forget()
            if former is None:
                return None
            return ground_motion(info.K, former, self._pose, params.ground_height)
        if image is None or params.camera_motion is CameraMotion.ODOMETRY:
            return None
        return self._motion.step(color.gray_of(image), self._tracker.tracks.boxes)

    def _pose_at(self, header: Header, params: TrackerParams, frames: FrameTree) -> Floats | None:
        if params.camera_motion in (CameraMotion.IMAGE, CameraMotion.NONE):
            return None
        try:
            return frames.lookup(params.fixed_frame, header.frame_id, header.stamp_ns)
        except NoTransform:
            if params.camera_motion is CameraMotion.ODOMETRY:
                raise
            return None

    def _count(self, boxes: Floats, ids: Numbers, header: Header) -> DiagnosticArray | None:
        """Count the detected tracks; the counts if they changed."""
        points = _ground_points(boxes, self._params.stands_on)
        sides = np.sqrt(boxes[:, 2:].prod(axis=1))
        for shape in self._shapes:
            shape.step(ids, points, sides)
        counts = {one.name: one.counts for one in self._shapes}
        if not counts or counts == self._counts:
            return None
        self._counts = counts
        return DiagnosticArray(
            tuple(
                DiagnosticStatus(name, values={what: str(n) for what, n in values.items()})
                for name, values in counts.items()
            ),
            header,
        )

    def _drawn(self, image: Image, found: Detections) -> Image:
        color.refuse_measurements(image.encoding)
        pixels = color.demosaiced(image.pixels, image.encoding)
        order, tracks = color.order_of(image.encoding), self._tracker.tracks
        trails = dict(zip(tracks.ids.tolist(), tracks.trails, strict=True))
        shapes = [(one.name, one.points_uv, one.counts) for one in self._shapes]
        shown = Deferred(
            (image.height, image.width, 3),
            np.uint8,
            lambda: draw_tracks(pixels, order, found.detections, trails, shapes),
        )
        return replace(image, data=shown, encoding="bgr8")

    def _markers(
        self, header: Header, info: CameraInfo | None, params: TrackerParams
    ) -> MarkerArray | None:
        """The tracks on the ground, ten times a second; None if the camera's pose is unknown."""
        due_ns = self._marked_ns + _MARKERS_NS
        if info is None or self._pose is None or self._marked_ns <= header.stamp_ns < due_ns:
            return None
        self._marked_ns = header.stamp_ns
        tracks = self._tracker.tracks
        rows = np.nonzero((tracks.ids > 0) & (self._tracker.now_ns - tracks.seen_ns < _MARKERS_NS))[
            0
        ]
        points = _ground_points(tracks.boxes[rows], params.stands_on)
        places = on_ground(points, info, self._pose, params.ground_height)
        for id, place in zip(tracks.ids[rows].tolist(), places, strict=True):
            if np.isfinite(place).all():
                self._trails.setdefault(id, deque(maxlen=_TRAIL)).appendleft(place)
        self._trails = {id: self._trails[id] for id in tracks.ids.tolist() if id in self._trails}
        size = _MARKER * abs(self._pose[2, 3] - params.ground_height)
        shown = {id: np.array(trail) for id, trail in self._trails.items()}
        return ground_markers(shown, size, Header(header.stamp_ns, params.fixed_frame))


def _usable(found: Detections) -> tuple[list[Detection], Floats]:
    """The detections that have a box, and their boxes (N, 4)."""
    boxes = found.boxes_uv
    rows = np.nonzero(np.isfinite(boxes).all(axis=1) & (boxes[:, 2:].min(axis=1, initial=1) > 0))[0]
    return [found.detections[row] for row in rows], boxes[rows]


def _size(shown: CameraInfo | Image | None, boxes: Floats) -> tuple[int, int] | None:
    """Width and height of the image; None if they are unknown, or do not hold the boxes (N, 4)."""
    if shown is None or not in_view(boxes, (shown.width, shown.height)).all():
        return None
    return shown.width, shown.height


def _ground_points(boxes: Floats, place: GroundPoint) -> Floats:
    below = 0.5 if place is GroundPoint.BOTTOM else 0.0
    points: Floats = boxes[:, :2] + boxes[:, 2:] * [0.0, below]
    return points
