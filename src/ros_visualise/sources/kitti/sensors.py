"""Images of KITTI's cameras, checked when they are read and decoded when somebody looks."""

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
from ros_visualise.data import (
    Path as PathMessage,
)
from ros_visualise.geometry import transforms
from ros_visualise.sources.kitti.files import Files
from ros_visualise.sources.series import DamagedFile, Series, single

MAP, ODOM, BASE = "map", "odom", "base_link"
IMU, VELODYNE = "imu_link", "velodyne"


def optical_frame(camera: int) -> str:
    """The optical frame of a camera."""
    return f"cam{camera:02d}_optical"


def static_series(start_ns: int, places: Sequence[tuple[str, str, Floats]]) -> Series:
    """``/tf_static``: one message with all of (parent, child, T_parent_child)."""
    sent = tuple(
        TransformStamped(child, *transforms.to_pose(T), Header(start_ns, parent))
        for parent, child, T in places
    )
    return single("/tf_static", Transforms(sent), start_ns)


def path_series(
    start_ns: int, stamps_ns: npt.NDArray[np.int64], positions_xyz: Floats, quats_xyzw: Floats
) -> Series:
    """``/path``: the whole way in one latched message at the start, so that a bag stays small."""
    order = np.argsort(stamps_ns, kind="stable")
    header = Header(start_ns, ODOM)
    path = PathMessage(stamps_ns[order], positions_xyz[order], quats_xyzw[order], header)
    return single("/path", path, start_ns)


def moving_transforms(
    stamps_ns: npt.NDArray[np.int64], positions_xyz: Floats, quats_xyzw: Floats
) -> Series:
    """``/tf``: where base_link is in odom."""

    def make(index: int) -> Transforms:
        header = Header(int(stamps_ns[index]), ODOM)
        return Transforms(
            (TransformStamped(BASE, positions_xyz[index], quats_xyzw[index], header),)
        )

    return Series("/tf", Transforms, stamps_ns, make)


_POINT = np.dtype([(name, np.float32) for name in ("x", "y", "z", "intensity")])


class Scanner:
    """The scans, each stamped with the time at which the scanner looked ahead.

    Points are in metres; intensity is 0 to 1. The times at which a turn began and ended are
    published beside them. Points have no times of their own: KITTI's files do not keep their order.

    Args:
        files: of four 32-bit floats a point; or of text, as unsynced drives have them.
        stamps_ns: (N,).
    """

    def __init__(self, files: Files, stamps_ns: npt.NDArray[np.int64], frame_id: str) -> None:
        self._files, self._stamps_ns, self._frame_id = files, stamps_ns, frame_id

    def cloud(self, index: int) -> PointCloud:
        """One turn of the scanner.

        Raises:
            DamagedFile: it does not end with a whole point, or is no scan.
        """
        rows = self._rows(index)
        header = Header(int(self._stamps_ns[index]), self._frame_id)
        return PointCloud(rows.view(_POINT)[:, 0], bool(np.isfinite(rows).all()), header)

    def _rows(self, index: int) -> npt.NDArray[np.float32]:
        path, data = self._files.path(index), self._files.read(index)
        if path.suffix == ".txt":
            try:
                numbers = np.array(data.split(), np.float32)
            except ValueError:
                raise DamagedFile(path, "holds more than numbers") from None
            if numbers.size % 4:
                raise DamagedFile(path, "cut off")
            return numbers.reshape(-1, 4)
        if len(data) % _POINT.itemsize:
            raise DamagedFile(path, "cut off, or no scan: it does not end with a whole point")
        return np.frombuffer(data, np.dtype("<f4")).reshape(-1, 4)


_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK = 12  # length, type and CRC around a chunk's data
_COLOR_BYTES = 3  # of a pixel
_PATIENCE = 8


class Demand:
    """Tells whether a camera's images are in use, so that decoding ahead is worth it."""

    def __init__(self) -> None:
        self._left = 0
        self._lock = threading.Lock()

    def renew(self) -> None:
        """An image was looked at."""
        with self._lock:
            self._left = _PATIENCE

    def take(self) -> bool:
        """Whether to decode one more: yes, unless nobody looked at the last few."""
        with self._lock:
            self._left -= 1
            return self._left >= 0


class Camera:
    """The images of one camera.

    Args:
        files: PNG files.
        stamps_ns: (N,).
        color: as bgr8 rather than mono8.
        frame_id: its optical frame.
        info: its calibration, if it is known.
    """

    def __init__(
        self,
        files: Files,
        stamps_ns: npt.NDArray[np.int64],
        color: bool,
        frame_id: str,
        info: CameraInfo | None,
    ) -> None:
        self._files, self._stamps_ns = files, stamps_ns
        self._color, self._frame_id, self._info = color, frame_id, info
        self._demand = Demand()

    def image(self, index: int) -> Image:
        """An image; decoded ahead while images are in use.

        Raises:
            DamagedFile: it is not a PNG, or cut off, or corrupt.
        """
        path, data = self._files.path(index), self._files.read(index)
        height, width = check_png(path, data)
        decoded = decode(path, data, self._color) if self._demand.take() else None
        shape = (height, width, 3) if self._color else (height, width)
        pixels = Deferred(shape, np.uint8, partial(self._look, path, data, decoded))
        encoding = "bgr8" if self._color else "mono8"
        info = None if self._info is None else self.info(index)
        return Image(pixels, encoding, self._header(index), info)

    def info(self, index: int) -> CameraInfo:
        """The calibration that goes with an image."""
        assert self._info is not None, "only of a calibrated camera"
        return replace(self._info, header=self._header(index))

    def _header(self, index: int) -> Header:
        return Header(int(self._stamps_ns[index]), self._frame_id)

    def _look(self, path: Path, data: bytes, decoded: Pixels | None) -> Pixels:
        self._demand.renew()
        return decode(path, data, self._color) if decoded is None else decoded


def decode(path: Path, data: bytes, color: bool) -> Pixels:
    """The pixels of a PNG: (height, width, 3) in the order BGR, or (height, width).

    Raises:
        DamagedFile: OpenCV cannot decode it.
    """
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
    width, height = read_size(data)
    if not width or not height:
        raise DamagedFile(path, "a PNG image without a size")
    try:
        check_image(width, height, _COLOR_BYTES)
    except TooLarge as error:
        raise DamagedFile(path, str(error)) from None
    return height, width


def read_size(head: bytes) -> tuple[int, int]:
    """Width and height in the first 24 bytes of a PNG; 0, 0 of anything else."""
    if len(head) < 24 or not head.startswith(_SIGNATURE) or head[12:16] != b"IHDR":
        return 0, 0
    width, height = struct.unpack_from(">II", head, len(_SIGNATURE) + 8)
    return width, height


def first_size(files: Files) -> tuple[int, int]:
    """Width and height of the first image that says so; 0, 0 where none does."""
    for index in range(len(files)):
        try:
            with open_file(files.path(index)) as file:
                size = read_size(file.read(24))
        except OSError:
            continue
        if all(size):
            return size
    return 0, 0
