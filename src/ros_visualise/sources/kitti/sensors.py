"""Topics of KITTI's cameras and scanner, and the frames and transforms of the car."""

from __future__ import annotations

import contextlib
import struct
import threading
import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise import data as messages
from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_image
from ros_visualise.core.regular_files import open_file
from ros_visualise.data import (
    CameraInfo,
    Deferred,
    Floats,
    Header,
    Image,
    Pixels,
    PointCloud,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import se3
from ros_visualise.sources.kitti.files import FrameFiles
from ros_visualise.sources.series import DamagedFile, Series, single

MAP, ODOM, BASE = "map", "odom", "base_link"
IMU, VELODYNE = "imu_link", "velodyne"

Places = list[tuple[str, str, Floats]]
"""(Parent, child, T_parent_child) of frames."""

_POINT = np.dtype([(name, np.float32) for name in ("x", "y", "z", "intensity")])
_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = 12  # length, type and CRC around a chunk's data
_COLOR_BYTES = 3  # of a pixel
_PATIENCE = 8

_Stamps = npt.NDArray[np.int64]


def optical_frame(camera: int) -> str:
    """The optical frame of a camera."""
    return f"cam{camera:02d}_optical"


def static_series(start_ns: int, places: Places) -> Series:
    """``/tf_static``: one message with all of these frames."""
    sent = tuple(
        TransformStamped(child, *se3.to_pose(T), Header(start_ns, parent))
        for parent, child, T in places
    )
    return single("/tf_static", Transforms(sent), start_ns)


def moving_series(
    start_ns: int, stamps_ns: _Stamps, positions_xyz: Floats, quats_xyzw: Floats
) -> Sequence[Series]:
    """``/path``: the whole way in one latched message, which keeps a bag small; and ``/tf``."""
    order = np.argsort(stamps_ns, kind="stable")
    poses = positions_xyz[order], quats_xyzw[order]
    path = messages.Path(stamps_ns[order], *poses, Header(start_ns, ODOM))

    def transform(index: int) -> Transforms:
        header = Header(int(stamps_ns[index]), ODOM)
        return Transforms(
            (TransformStamped(BASE, positions_xyz[index], quats_xyzw[index], header),)
        )

    return single("/path", path, start_ns), Series("/tf", Transforms, stamps_ns, transform)


def scanner_series(files: FrameFiles, stamps_ns: _Stamps) -> Series:
    """``/velodyne_points``, each scan stamped with the time at which the scanner looked ahead.

    Points are in metres; intensity is 0 to 1. They have no times of their own, as KITTI's files do
    not keep their order. Files hold four 32-bit floats a point; of unsynced drives, text.
    """

    def cloud(index: int) -> PointCloud:
        rows = _read_scan(files.path(index), files.read(index))
        header = Header(int(stamps_ns[index]), VELODYNE)
        return PointCloud(rows.view(_POINT)[:, 0], bool(np.isfinite(rows).all()), header)

    return Series("/velodyne_points", PointCloud, stamps_ns, cloud, slow=True)


def _read_scan(path: Path, data: bytes) -> npt.NDArray[np.float32]:
    if path.suffix == ".txt":
        try:
            numbers = np.array(data.split(), np.float32)
        except ValueError:
            raise DamagedFile(path, "contains text that is not a number") from None
        if numbers.size % 4:
            raise DamagedFile(path, "cut off")
        return numbers.reshape(-1, 4)
    if len(data) % _POINT.itemsize:
        raise DamagedFile(path, "cut off, or not a scan: its last point is incomplete")
    return np.frombuffer(data, np.dtype("<f4")).reshape(-1, 4)


def camera_series(
    number: int, name: str, files: FrameFiles, stamps_ns: _Stamps, info: CameraInfo | None
) -> list[Series]:
    """A camera's images and, if it is calibrated, its camera_info."""
    room = f"/cam{number:02d}"
    images = _Images(files, stamps_ns, number >= 2, optical_frame(number), info)
    series = [Series(f"{room}/{name}", Image, stamps_ns, images.image, slow=True)]
    if info is not None:
        series.append(Series(f"{room}/camera_info", CameraInfo, stamps_ns, images.info))
    return series


class _Images:
    """The images of one camera, checked when they are read; decoded ahead while they are in use."""

    def __init__(
        self,
        files: FrameFiles,
        stamps_ns: _Stamps,
        color: bool,
        frame_id: str,
        info: CameraInfo | None,
    ) -> None:
        self._files, self._stamps_ns = files, stamps_ns
        self._color, self._frame_id, self._info = color, frame_id, info
        self._lock = threading.Lock()
        self._ahead = 0  # so many are decoded ahead until one is used

    def image(self, index: int) -> Image:
        path, data = self._files.path(index), self._files.read(index)
        height, width = check_png(path, data)
        with self._lock:
            self._ahead -= 1
            is_in_use = self._ahead >= 0
        decoded = _decode(path, data, self._color) if is_in_use else None
        shape = (height, width, 3) if self._color else (height, width)
        pixels = Deferred(shape, np.uint8, partial(self._pixels, path, data, decoded))
        encoding = "bgr8" if self._color else "mono8"
        info = None if self._info is None else self.info(index)
        return Image(pixels, encoding, self._header(index), info)

    def info(self, index: int) -> CameraInfo:
        assert self._info is not None, "only of a calibrated camera"
        return replace(self._info, header=self._header(index))

    def _header(self, index: int) -> Header:
        return Header(int(self._stamps_ns[index]), self._frame_id)

    def _pixels(self, path: Path, data: bytes, decoded: Pixels | None) -> Pixels:
        with self._lock:
            self._ahead = _PATIENCE
        return _decode(path, data, self._color) if decoded is None else decoded


def _decode(path: Path, data: bytes, color: bool) -> Pixels:
    """The pixels of a PNG: (height, width, 3) in the order BGR, or (height, width)."""
    flags = (cv2.IMREAD_COLOR if color else cv2.IMREAD_GRAYSCALE) | cv2.IMREAD_IGNORE_ORIENTATION
    pixels: Pixels | None = None
    with contextlib.suppress(cv2.error):
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if pixels is None:
        raise DamagedFile(path, "OpenCV cannot decode it")
    return pixels


def check_png(path: Path, data: bytes) -> tuple[int, int]:
    """Height and width of an intact PNG, checked by its checksums, not decoded.

    Raises:
        DamagedFile: it is not intact, or its pixels would take too much.

    Source: W3C, Portable Network Graphics Specification, section 5.
    """
    if not data.startswith(_SIGNATURE):
        raise DamagedFile(path, "not a PNG image")
    view, at, kind = memoryview(data), len(_SIGNATURE), b""
    while kind != b"IEND":
        if at + _CHUNK > len(data):
            raise DamagedFile(path, "cut off")
        length, kind = struct.unpack_from(">I4s", data, at)
        end = at + 8 + length
        if end + 4 > len(data):
            raise DamagedFile(path, "cut off")
        if zlib.crc32(view[at + 4 : end]) != struct.unpack_from(">I", data, end)[0]:
            raise DamagedFile(path, "damaged: its checksum is wrong")
        at = end + 4
    width, height = _read_size(data)
    if not width or not height:
        raise DamagedFile(path, "a PNG image without a size")
    try:
        check_image(width, height, _COLOR_BYTES)
    except TooLarge as error:
        raise DamagedFile(path, str(error)) from None
    return height, width


def first_size(files: FrameFiles) -> tuple[int, int]:
    """Width and height of the first readable image; 0, 0 without one."""
    for index in range(len(files)):
        with contextlib.suppress(OSError), open_file(files.path(index)) as file:
            size = _read_size(file.read(24))
            if all(size):
                return size
    return 0, 0


def _read_size(head: bytes) -> tuple[int, int]:
    """Width and height in the first 24 bytes of a PNG; 0, 0 of anything else."""
    if len(head) < 24 or not head.startswith(_SIGNATURE) or head[12:16] != b"IHDR":
        return 0, 0
    width, height = struct.unpack_from(">II", head, len(_SIGNATURE) + 8)
    return width, height
