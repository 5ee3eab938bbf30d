"""Inputs of ``odometry``: images in the order of time, calibrated if possible, and positions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.commands.odometry import OdometryOptions
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.regular_files import read_text
from ros_visualise.data import (
    CameraInfo,
    Floats,
    Image,
    Imu,
    NavSatFix,
    Pixels,
    Transforms,
)
from ros_visualise.estimation.visual.stereo import StereoPairs, right_of
from ros_visualise.geometry.frames import FrameTree, WrongTransforms
from ros_visualise.geometry.located import Locator
from ros_visualise.messages.calibrations import calibration_topic
from ros_visualise.sources import open_source
from ros_visualise.sources.calibration import Calibration
from ros_visualise.sources.pictures import Pictures, is_pictures
from ros_visualise.sources.recordings import Recording, readable
from ros_visualise.sources.recordings.images import image_topic
from ros_visualise.vision import color

_CALIB = "calib.txt"
_WHEELS = 0.02  # m, of positions that have no covariance


class CameraImage(NamedTuple):
    """An image, gray (H, W) uint8, that of the right camera, if any, and the camera's frame."""

    stamp_ns: int
    gray: Pixels
    right: Pixels | None = None
    frame: str = ""


class Position(NamedTuple):
    """A measured position (3,), and its standard deviation, metres."""

    stamp_ns: int
    xyz: Floats
    sigma: float


@dataclass
class CameraInput:
    """Images and their calibrations.

    Attributes:
        infos: of the camera, and of the right one; empty if it is not calibrated.
        cameras: T_left_camera (C, 4, 4).
        notes: damage of the input, a line each.
        frames: the transforms so far, if an IMU is read.
    """

    infos: list[CameraInfo] = field(default_factory=list)
    cameras: Floats = field(default_factory=lambda: np.eye(4)[None])
    notes: list[str] = field(default_factory=list)
    frames: FrameTree = field(default_factory=FrameTree)

    def read(self) -> Iterator[CameraImage | Position | Imu]:
        """All images, positions and measurements of an IMU, in order."""
        raise NotImplementedError


def open_input(options: OdometryOptions) -> CameraInput:
    """Open the input of the command line.

    Raises:
        OpenError, UsageError: it has no images.
    """
    folder = _pictures(Path(options.input))
    found = _Folder(folder, options) if folder else _Recorded(options)
    if options.calibration:
        found.infos = [_read_calibration(options.calibration, found.size)]
    return found


class _Folder(CameraInput):
    def __init__(self, folder: Path, options: OdometryOptions) -> None:
        super().__init__()
        if options.scale or options.imu or options.right not in (None, "none"):
            raise UsageError(
                f"{folder}: a folder of pictures has no topics; omit --scale, --imu and --right"
            )
        self._pictures = Pictures(folder, options.fps)
        first = next(image for _, image in self._pictures.read())
        self.size = (first.width, first.height)
        calib = next(
            (one / _CALIB for one in (folder, folder.parent) if (one / _CALIB).is_file()), None
        )
        if calib and not options.calibration:
            self.infos = [_read_calibration(str(calib), self.size)]

    def read(self) -> Iterator[CameraImage | Position | Imu]:
        for stamp_ns, image in self._pictures.read():
            yield CameraImage(stamp_ns, color.gray_of(image))
        self.notes = self._pictures.faults


class _Recorded(CameraInput):
    def __init__(self, options: OdometryOptions) -> None:
        super().__init__()
        self._path = Path(options.input)
        with closing(open_source(self._path)) as recording:
            self._topic = image_topic(recording, options.topic)
            info, self.size = _look(recording, self._topic)
            self.infos = [info] if info else []
            self._right = ""
            use_right = options.right != "none" and not options.imu
            if info and not options.calibration and use_right:
                self._find_right(recording, info, options.right)
            self._scale = self._topic_of(recording, options.scale)
            self._imu = self._topic_of(recording, options.imu)
            self._moving: list[str] = []
            if self._imu:
                if recording.topics[self._imu].type.data_class is not Imu:
                    raise UsageError(f"{self._path}: no IMU measurements on {options.imu}")
                self.frames = _static_frames(recording)
                self._moving = [name for name in recording.topics if name.lstrip("/") == "tf"]

    def _topic_of(self, recording: Recording, wanted: str | None) -> str | None:
        """A topic of the recording by its name, also without the first slash."""
        named = {name.lstrip("/"): name for name in recording.topics}
        if wanted and wanted.lstrip("/") not in named:
            raise UsageError(f"{self._path}: no topic {wanted}")
        return named[wanted.lstrip("/")] if wanted else None

    def _find_right(self, recording: Recording, info: CameraInfo, wanted: str | None) -> None:
        """The other camera of a stereo pair, if there is one."""
        images = [name for name, one in recording.topics.items() if one.type.data_class is Image]
        if wanted and wanted not in images:
            raise UsageError(f"{recording.path}: no image topic {wanted}")
        tree = _static_frames(recording)
        for name in [wanted] if wanted else images:
            other, size = _look(recording, name)
            T = right_of(info, other, tree) if other and name != self._topic else None
            if other and T is not None and size == self.size:
                self._right, self.infos = name, [info, other]
                self.cameras = np.stack([np.eye(4), T])
                return
        if wanted:
            raise UsageError(
                f"{wanted}: no calibration or transform places it to the right of {self._topic}"
            )

    def read(self) -> Iterator[CameraImage | Position | Imu]:
        several = (self._topic, self._right, self._scale, self._imu, *self._moving)
        topics = [one for one in several if one]
        locator, pairs = Locator(), StereoPairs[CameraImage]()
        with closing(open_source(self._path)) as recording:
            for topic, recorded_ns, message in readable(recording, topics):
                if isinstance(message, Transforms):
                    with suppress(WrongTransforms):
                        self.frames.add(message)
                    continue
                if isinstance(message, Imu):
                    yield message
                    continue
                stamp_ns = message.header.stamp_ns or recorded_ns
                if topic == self._scale:
                    found = locator.locate(message)
                    if found is not None:
                        yield Position(stamp_ns, found[:3], _sigma(message))
                    continue
                gray = color.gray_of(message)
                view = CameraImage(stamp_ns, gray, frame=message.header.frame_id)
                if not self._right:
                    yield view
                    continue
                pair = pairs.add(stamp_ns, view, topic == self._right)
                if pair is not None:
                    yield pair[0]._replace(right=pair[1].gray)
            self.notes = list(recording.loss.notes)


def _pictures(path: Path) -> Path | None:
    """The folder with pictures: a path itself, or the only such folder in it."""
    if not path.is_dir():
        return None
    if is_pictures(path):
        return path
    with_pictures = [one for one in sorted(path.iterdir()) if one.is_dir() and is_pictures(one)]
    only = len(with_pictures) == 1 and not (path / "times.txt").exists()
    return with_pictures[0] if only else None


def _static_frames(recording: Recording) -> FrameTree:
    tree = FrameTree()
    topics = [name for name in recording.topics if name.lstrip("/") == "tf_static"]
    for entry in readable(recording, topics):
        with suppress(WrongTransforms):
            tree.add(entry.message, True)
    return tree


def _look(recording: Recording, topic: str) -> tuple[CameraInfo | None, tuple[int, int]]:
    """The calibration of a topic of images, and their size."""
    types = {name: one.type for name, one in recording.topics.items()}
    of_info = calibration_topic(topic, types)
    info, size = None, None
    with closing(readable(recording, [one for one in (topic, of_info) if one])) as entries:
        for _, _, message in entries:
            if isinstance(message, CameraInfo):
                info = message if message.K[0, 0] > 0 else None
            elif isinstance(message, Image):
                size = (message.width, message.height)
                info = info or message.camera_info
            if size and (info or not of_info):
                break
    if size is None:
        raise OpenError(f"{recording.path}: no readable image on {topic}")
    return info if info and info.K[0, 0] > 0 else None, size


def _sigma(message: Any) -> float:
    """Standard deviation of a position, metres."""
    if isinstance(message, NavSatFix):
        variance = float(np.mean(np.diag(message.covariance)[:2]))
        return float(np.sqrt(variance)) if variance > 0 else 2.0
    return _WHEELS


def _read_calibration(name: str, size: tuple[int, int]) -> CameraInfo:
    """The calibration in ROS's format, or KITTI's; raises OpenError."""
    path = Path(name)
    if path.suffix == ".txt":
        return _read_rows(path, size)
    info = Calibration(name).fit(size)
    if info is None:
        raise OpenError.missing(path)
    return info


def _read_rows(path: Path, size: tuple[int, int]) -> CameraInfo:
    """The first camera of KITTI's calib.txt, also without names."""
    try:
        text = read_text(path)
        row = np.array(text.splitlines()[0].rpartition(":")[2].split(), np.float64)
        P = row.reshape(3, 4)
    except (OSError, ValueError, IndexError):
        raise OpenError(
            f"{path}: not a KITTI calibration file, which has 12 numbers on each line"
        ) from None
    if not (np.isfinite(P).all() and P[0, 0] > 0 and P[1, 1] > 0):
        raise OpenError(f"{path}: not a camera's projection matrix")
    return replace(CameraInfo(size[1], size[0], P[:, :3]), P=P)
