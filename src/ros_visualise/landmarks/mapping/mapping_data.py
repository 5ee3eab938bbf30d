"""The data for a map, gathered while a recording is played."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Detection, Detections, Floats, Imu, Transforms
from ros_visualise.geometry.frames import FrameTree, WrongTransforms
from ros_visualise.landmarks.mapping.mounting import Gyro
from ros_visualise.landmarks.mapping.problem import CameraPath, Problem, TagSighting

_FOR_EVER_S = 1e9
_MOST_VIEWS = 3000
"""Largest number of views; of more, only every second or third is used."""

_MOST_BEFORE = 200
"""Views before the first tag, for the odometry's error by then."""

_FROZEN = "images identical to the previous one (frozen camera)"


class MappingData:
    """Detections and frames of a recording; may be filled from any thread.

    Attributes:
        frames: the frame tree over time.
        skipped: number of unused sightings or images, by reason.
    """

    def __init__(self) -> None:
        self.frames = FrameTree(_FOR_EVER_S)
        self.skipped: Counter[str] = Counter()
        self.messages: list[Detections] = []
        self._turns: list[tuple[float, ...]] = []
        self._imu_frame = ""
        self._lock = threading.Lock()

    @property
    def tag_names(self) -> set[str]:
        """Classes of all detections with tag corners."""
        return {o.class_id for m in self.messages for o in m.detections if is_tag(o)}

    def add_found(self, message: Detections) -> None:
        """Add the detections of one image."""
        with self._lock:
            self.messages.append(message)

    def add_frames(self, message: Transforms, static: bool) -> None:
        """Add transforms; invalid ones are skipped, and reported by the nodes that need them."""
        try:
            self.frames.add(message, static)
        except WrongTransforms:
            return

    def add_imu(self, message: Imu) -> None:
        """Add an IMU measurement, unless it has no angular velocity."""
        if message.angular_covariance[0, 0] != -1:
            with self._lock:
                self._imu_frame = message.header.frame_id
                self._turns.append((message.header.stamp_ns, *message.angular_xyz))

    def gyro(self, stamps_ns: npt.NDArray[np.int64]) -> Gyro | None:
        """The angular velocities; None without an IMU, or if its frame is unknown."""
        camera = next((one.header.frame_id for one in self._with_tags()), "")
        with self._lock:
            turns = sorted(self._turns)
        if not turns:
            return None
        try:
            T = [self.frames.lookup(self._imu_frame, camera, int(t), 0.05) for t in stamps_ns]
        except NoTransform:
            return None
        times = np.array([one[0] for one in turns], np.int64)
        return Gyro(times, np.array([one[1:] for one in turns]), np.array(T)[:, :3, :3])

    def problem(self, size_of: Callable[[Detection], float], frame_id: str) -> Problem:
        """The problem: images with tags, and the camera poses given by tf.

        Args:
            size_of: side of a tag in metres; 0 if unknown.
            frame_id: the fixed frame; empty without one.
        """
        self.skipped.clear()
        T_fixed: list[Floats] = []
        stamps: list[int] = []
        found: list[list[tuple[Detection, Detections]]] = []
        with_tags = self._thinned(self._fresh(sorted(self._with_tags(), key=_stamp)))
        before = self._before(with_tags, frame_id) if frame_id else []
        for message in [*before, *with_tags]:
            T = self.place(frame_id, message) if frame_id else np.eye(4)
            if T is None:
                self.skipped["images without a transform at their time"] += 1
                continue
            T_fixed.append(T)
            stamps.append(message.header.stamp_ns)
            found.append([(one, message) for one in self._usable(message, size_of)])
        names = sorted({one.class_id for view in found for one, _ in view})
        sightings = [
            _sighting(view, names, one, message, size_of(one))
            for view, several in enumerate(found)
            for one, message in several
        ]
        odometry = CameraPath(np.array(T_fixed)) if frame_id and T_fixed else None
        problem = Problem(np.array(stamps, np.int64), names, sightings, odometry)
        return problem if odometry else _together(problem, self.skipped)

    def place(self, frame_id: str, message: Detections) -> Floats | None:
        """T_fixed_camera (4, 4) according to tf; None if unknown."""
        header = message.header
        try:
            return self.frames.lookup(frame_id, header.frame_id, header.stamp_ns, 0.05)
        except NoTransform:
            return None

    def _with_tags(self) -> list[Detections]:
        with self._lock:
            return [one for one in self.messages if any(map(is_tag, one.detections))]

    def _before(self, with_tags: list[Detections], frame_id: str) -> list[Detections]:
        """Images before the first tag, during which the odometry already accumulates errors."""
        first_ns = _stamp(with_tags[0]) if with_tags else 0
        with self._lock:
            several = [one for one in self.messages if _stamp(one) < first_ns]
        several.sort(key=_stamp)
        every = -(-len(several) // _MOST_BEFORE) if several else 1
        return [one for one in several[::every] if self.place(frame_id, one) is not None]

    def _fresh(self, messages: list[Detections]) -> list[Detections]:
        """The messages without exact repetitions of the previous one."""
        kept = messages[:1]
        kept += [one for before, one in pairwise(messages) if not _is_same(one, before)]
        if len(kept) < len(messages):
            self.skipped[_FROZEN] = len(messages) - len(kept)
        return kept

    def _thinned(self, messages: list[Detections]) -> list[Detections]:
        every = -(-len(messages) // _MOST_VIEWS) if messages else 1
        kept = messages[::every]
        if len(kept) < len(messages):
            self.skipped["images thinned out"] = len(messages) - len(kept)
        return kept

    def _usable(
        self, message: Detections, size_of: Callable[[Detection], float]
    ) -> list[Detection]:
        tags = [one for one in message.detections if is_tag(one)]
        known = [one for one in tags if one.hypotheses[0].covariance.any() and size_of(one) > 0]
        if len(known) < len(tags):
            self.skipped["tags without a pose"] += len(tags) - len(known)
        return known if message.camera_info else []


def is_tag(one: Detection) -> bool:
    """True if it is a tag of a unique class."""
    return len(one.corners_uv) == 4 and bool(one.hypotheses)


def _is_same(one: Detections, other: Detections) -> bool:
    corners, others = ([d.corners_uv for d in m.detections if is_tag(d)] for m in (one, other))
    return len(corners) == len(others) and all(map(np.array_equal, corners, others))


def _stamp(message: Detections) -> int:
    return message.header.stamp_ns


def _sighting(
    view: int, names: list[str], one: Detection, message: Detections, size_m: float
) -> TagSighting:
    assert message.camera_info is not None
    poses = [h for h in one.hypotheses if h.class_id == one.class_id and h.covariance.any()]
    tag = names.index(one.class_id)
    return TagSighting(view, tag, one.corners_uv, size_m, message.camera_info, poses)


def _together(problem: Problem, skipped: Counter[str]) -> Problem:
    """The problem without views of a single tag, which are useless without tf."""
    tags: dict[int, set[int]] = {}
    for one in problem.sightings:
        tags.setdefault(one.view, set()).add(one.tag)
    several = np.array(
        [len(tags.get(view, ())) > 1 for view in range(len(problem.stamps_ns))], bool
    )
    if not several.any():
        several[[one.view for one in problem.sightings[:1]]] = True
    seen = {one.tag for one in problem.sightings if several[one.view]}
    if not several.all():
        skipped["images of a single tag, without tf"] = int((~several).sum())
    return problem.restricted(
        several, np.array([n in seen for n in range(len(problem.names))], bool)
    )
