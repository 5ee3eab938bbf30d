"""The data for a map, gathered while a recording is played."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Detection, Detections, Floats, Imu, Transforms
from ros_visualise.estimation.mapping.intrinsics import assumed
from ros_visualise.estimation.mapping.mounting import Gyro
from ros_visualise.estimation.mapping.problem import CameraPath, Problem, RigCamera, TagSighting
from ros_visualise.estimation.mapping.rig import (
    GIVEN_M,
    GIVEN_RAD,
    CameraImage,
    estimated_rig,
    views_of,
)
from ros_visualise.geometry.frames import FrameTree, WrongTransforms
from ros_visualise.geometry.se3 import inverse

_FOR_EVER_S = 1e9
_MOST_VIEWS = 3000
"""Largest number of views; of more, only every second or third is used."""

_MOST_BEFORE = 200
"""Views before the first tag, for the odometry's error by then."""

_FROZEN = "images identical to the previous one (frozen camera)"


class MappingData:
    """Detections and frames of a recording; may be filled from any thread.

    Args:
        cameras: their names, and what is known of their calibration.

    Attributes:
        frames: the frame tree over time.
        skipped: number of unused sightings or images, by reason.
    """

    def __init__(self, cameras: Sequence[RigCamera] = (RigCamera(),)) -> None:
        self.frames = FrameTree(_FOR_EVER_S)
        self.skipped: Counter[str] = Counter()
        self._cameras = cameras
        self._images: list[CameraImage] = []
        self._places: dict[str, Detections] = {}
        self._turns: list[tuple[float, ...]] = []
        self._imu_frame = ""
        self._lock = threading.Lock()

    @property
    def messages(self) -> list[Detections]:
        """The detections of all images."""
        with self._lock:
            return [message for _, message in self._images]

    @property
    def tag_names(self) -> set[str]:
        """Classes of all detections with tag corners."""
        return {o.class_id for m in self.messages for o in m.detections if is_tag(o)}

    def add_found(self, message: Detections, camera: int = 0) -> None:
        """Add the detections of one image of a camera."""
        with self._lock:
            self._images.append((camera, message))

    def add_places(self, message: Detections) -> None:
        """Add the places that the first camera sees; the first sighting of each defines it."""
        with self._lock:
            for one in message.detections:
                self._places.setdefault(one.class_id, replace(message, detections=(one,)))

    @property
    def places(self) -> list[Detections]:
        """The first sighting of each place, one per message."""
        with self._lock:
            return list(self._places.values())

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
        camera = self._frame_of(0)
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
        known = [self._calibrated(number, one) for number, one in enumerate(self._cameras)]
        cameras, apart = self._by_tf(known)
        if apart:
            several = self._problem(size_of, frame_id, known, range(len(cameras)))
            estimated = estimated_rig(several, known)
            cameras = [estimated.get(number, one) for number, one in enumerate(cameras)]
            apart -= estimated.keys()
            self.skipped.clear()
        return self._problem(size_of, frame_id, cameras, apart)

    def _problem(
        self,
        size_of: Callable[[Detection], float],
        frame_id: str,
        cameras: Sequence[RigCamera],
        apart: Collection[int],
    ) -> Problem:
        """The problem with these poses of cameras in the rig; see `views_of`."""
        T_fixed: list[Floats] = []
        stamps: list[int] = []
        found: list[list[tuple[int, Detection, Detections]]] = []
        with_tags = self._thinned(views_of(self._fresh(), apart))
        before = self._before(with_tags, frame_id) if frame_id else []
        for images in self._with_places([*before, *with_tags]) if frame_id else with_tags:
            camera, first = images[0]
            T = self.place(frame_id, first) if frame_id else np.eye(4)
            if T is None:
                self.skipped["images without a transform at their time"] += len(images)
                continue
            T_fixed.append(T @ inverse(cameras[camera].T_first_camera))
            stamps.append(first.header.stamp_ns)
            found.append([(n, one, m) for n, m in images for one in self._usable(m, size_of)])
        names = sorted({one.class_id for view in found for _, one, _ in view})
        sightings = [
            _sighting(view, names, one, message, size_of(one), camera)
            for view, several in enumerate(found)
            for camera, one, message in several
        ]
        odometry = CameraPath(np.array(T_fixed)) if frame_id and T_fixed else None
        problem = Problem(np.array(stamps, np.int64), names, sightings, odometry, cameras=cameras)
        return problem if odometry else _together(problem, self.skipped)

    def _calibrated(self, number: int, camera: RigCamera) -> RigCamera:
        """The camera; if its calibration has unknown errors, with assumed ones."""
        if camera.is_exact or camera.calibration is not None:
            return camera
        with self._lock:
            images = [message for own, message in self._images if own == number]
        info = next(
            (one.camera_info for one in images if any(map(_is_located, one.detections))), None
        )
        return camera if info is None else replace(camera, calibration=assumed(info))

    def _by_tf(self, known: Sequence[RigCamera]) -> tuple[list[RigCamera], set[int]]:
        """The cameras with their poses in the rig, and the indices of those without."""
        cameras, apart = list(known), set()
        for number in range(1, len(cameras)):
            T = self._in_rig(number)
            if T is None:
                apart.add(number)
            else:
                cameras[number] = replace(
                    cameras[number], T_first_camera=T, sigma_m=GIVEN_M, sigma_rad=GIVEN_RAD
                )
        return cameras, apart

    def _in_rig(self, camera: int) -> Floats | None:
        """T_first_camera (4, 4) of a camera by tf; None if unknown."""
        first, own = self._frame_of(0), self._frame_of(camera)
        with self._lock:
            stamps = [_stamp(message) for number, message in self._images if number == camera]
        if not stamps or first == own:
            return None
        try:
            return self.frames.lookup(first, own, stamps[0], 0.05)
        except NoTransform:
            return None

    def _frame_of(self, camera: int) -> str:
        with self._lock:
            images = [message for number, message in self._images if number == camera]
        return images[0].header.frame_id if images else ""

    def place(self, frame_id: str, message: Detections) -> Floats | None:
        """T_fixed_camera (4, 4) according to tf; None if unknown."""
        header = message.header
        try:
            return self.frames.lookup(frame_id, header.frame_id, header.stamp_ns, 0.05)
        except NoTransform:
            return None

    def _with_places(self, views: list[list[CameraImage]]) -> list[list[CameraImage]]:
        """Views, and views of places between them, which the tags before and after locate."""
        known = {_stamp(images[0][1]) for images in views}
        places = {_stamp(one): one for one in self.places if _stamp(one) not in known}
        more = [[(0, replace(one, detections=()))] for one in places.values()]
        return sorted([*views, *more], key=lambda images: _stamp(images[0][1]))

    def _before(self, with_tags: list[list[CameraImage]], frame_id: str) -> list[list[CameraImage]]:
        """Images before the first tag, during which the odometry already accumulates errors."""
        first_ns = _stamp(with_tags[0][0][1]) if with_tags else 0
        with self._lock:
            images = [one for one in self._images if one[0] == 0 and _stamp(one[1]) < first_ns]
        images.sort(key=lambda one: _stamp(one[1]))
        every = -(-len(images) // _MOST_BEFORE) if images else 1
        return [[one] for one in images[::every] if self.place(frame_id, one[1]) is not None]

    def _fresh(self) -> list[CameraImage]:
        """The images with tags, without exact repetitions of the camera's previous one."""
        with self._lock:
            images = [one for one in self._images if any(map(is_tag, one[1].detections))]
        images.sort(key=lambda one: (one[0], _stamp(one[1])))
        kept = images[:1]
        kept += [
            one
            for before, one in pairwise(images)
            if before[0] != one[0] or not _is_same(one[1], before[1])
        ]
        if len(kept) < len(images):
            self.skipped[_FROZEN] = len(images) - len(kept)
        return kept

    def _thinned(self, views: list[list[CameraImage]]) -> list[list[CameraImage]]:
        every = -(-len(views) // _MOST_VIEWS) if views else 1
        kept = views[::every]
        if len(kept) < len(views):
            self.skipped["images thinned out"] = sum(map(len, views)) - sum(map(len, kept))
        return kept

    def _usable(
        self, message: Detections, size_of: Callable[[Detection], float]
    ) -> list[Detection]:
        tags = [one for one in message.detections if is_tag(one)]
        known = [one for one in tags if _is_located(one) and size_of(one) > 0]
        if len(known) < len(tags):
            self.skipped["tags without a pose"] += len(tags) - len(known)
        return known if message.camera_info else []


def is_tag(one: Detection) -> bool:
    """True if it is a tag of a unique class."""
    return len(one.corners_uv) == 4 and bool(one.hypotheses)


def _is_located(one: Detection) -> bool:
    """True if it is a tag with a pose."""
    return is_tag(one) and bool(one.hypotheses[0].covariance.any())


def _is_same(one: Detections, other: Detections) -> bool:
    corners, others = ([d.corners_uv for d in m.detections if is_tag(d)] for m in (one, other))
    return len(corners) == len(others) and all(map(np.array_equal, corners, others))


def _stamp(message: Detections) -> int:
    return message.header.stamp_ns


def _sighting(
    view: int,
    names: list[str],
    one: Detection,
    message: Detections,
    size_m: float,
    camera: int,
) -> TagSighting:
    assert message.camera_info is not None
    poses = [h for h in one.hypotheses if h.class_id == one.class_id and h.covariance.any()]
    tag = names.index(one.class_id)
    return TagSighting(view, tag, one.corners_uv, size_m, message.camera_info, poses, camera)


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
