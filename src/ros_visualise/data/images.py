"""Images, their encodings, and images as files."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.limits import check_image
from ros_visualise.core.message import Message
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.cameras import CameraInfo
from ros_visualise.data.fields import header, read_header
from ros_visualise.data.header import Header, Pixels, read_only
from ros_visualise.data.ros_fields import TabledMessage

_BAYER = ("rggb", "bggr", "gbrg", "grbg")

ENCODINGS: dict[str, tuple[str, int]] = {
    "mono8": ("uint8", 1),
    "mono16": ("uint16", 1),
    "bgr8": ("uint8", 3),
    "rgb8": ("uint8", 3),
    "bgra8": ("uint8", 4),
    "rgba8": ("uint8", 4),
    "bgr16": ("uint16", 3),
    "rgb16": ("uint16", 3),
    "bgra16": ("uint16", 4),
    "rgba16": ("uint16", 4),
    **{f"bayer_{pattern}8": ("uint8", 1) for pattern in _BAYER},
    **{f"bayer_{pattern}16": ("uint16", 1) for pattern in _BAYER},
}
"""Gray and colours: name in sensor_msgs/image_encodings -> (numpy dtype, channels)."""

_COLORLESS = ("8UC2", "16UC1", "16UC2")  # OpenCV's other unsigned types are gray or colours

_TYPES = {"8S": "int8", "16S": "int16", "32S": "int32", "32F": "float32", "64F": "float64"}

MEASUREMENTS: dict[str, tuple[str, int]] = {
    **{name: (f"uint{name.partition('U')[0]}", int(name[-1])) for name in _COLORLESS},
    **{
        f"{name}C{channels}": (dtype, channels)
        for name, dtype in _TYPES.items()
        for channels in (1, 2, 3, 4)
    },
}
"""Measurements in place of gray or colours, as in `ENCODINGS`.

Depth is ``32FC1`` in metres, NaN if unknown, or ``16UC1`` in millimetres, 0 if unknown (REP 118);
``mono16`` has the same bytes and is gray.
"""


class Deferred:
    """Pixels that are computed once, on first access from any thread.

    Args:
        shape: (height, width) or (height, width, channels) of the array that ``make`` returns.
        dtype: its type.
        make: called at most once.
    """

    def __init__(
        self, shape: tuple[int, ...], dtype: npt.DTypeLike, make: Callable[[], Pixels]
    ) -> None:
        self.shape = shape
        self.dtype = np.dtype(dtype)
        self._make: Callable[[], Pixels] | None = make
        self._pixels: Pixels | None = None
        self._lock = threading.Lock()

    @property
    def nbytes(self) -> int:
        """Bytes of the array."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __call__(self) -> Pixels:
        if self._pixels is None:
            with self._lock:
                if self._make is not None:
                    self._pixels = read_only(self._make())
                    self._make = None  # frees its inputs
        assert self._pixels is not None
        return self._pixels


_ALSO_CALLED = {
    "8UC1": "mono8",
    "8UC3": "bgr8",
    "8UC4": "bgra8",
    "16UC3": "bgr16",
    "16UC4": "bgra16",
}
"""OpenCV's names, without an order of colours -> the assumed encoding; 16UC1 is depth."""

_YUV422 = {"yuv422": "UYVY", "uyvy": "UYVY", "yuv422_yuy2": "YUYV", "yuyv": "YUYV"}
"""Encodings of many cameras -> the order of their bytes. They are read as bgr8."""

_PLANES = {"nv12": 1, "nv21": 1, "nv24": 4}
"""Encodings with planes of gray and colours -> bytes of colours for two of gray; read as bgr8."""


@dataclass(frozen=True, eq=False)
class Image(Message):
    """One image and, where the camera is calibrated, the calibration that goes with it.

    ``data`` is an array of shape (height, width) for one channel or (height, width, channels), or
    a `Deferred` that makes one; take the array from ``pixels``, which is read-only. ``encoding``
    is one of `ENCODINGS` or `MEASUREMENTS`.

    Raises:
        ValueError: shape or type do not fit the encoding, or the calibration is invalid.
    """

    type_name = "sensor_msgs/msg/Image"
    has_calibration = True
    waiting = 1
    plotted = False

    data: Pixels | Deferred
    encoding: str
    header: Header = Header()
    camera_info: CameraInfo | None = None

    def __post_init__(self) -> None:
        known = ENCODINGS if self.encoding in ENCODINGS else MEASUREMENTS
        if self.encoding not in known:
            raise ValueError(f"unknown encoding {self.encoding!r}")
        dtype, channels = known[self.encoding]
        depth = self.data.shape[2:] or (1,)
        if self.data.dtype != dtype or depth != (channels,) or len(self.data.shape) > 3:
            raise ValueError(
                f"the encoding {self.encoding} does not fit {self.data.dtype} data of shape"
                f" {self.data.shape}"
            )
        if not isinstance(self.camera_info, CameraInfo | None):
            raise ValueError(
                f"camera_info must be a CameraInfo, not a {type(self.camera_info).__name__}"
            )
        if not isinstance(self.data, Deferred):
            object.__setattr__(self, "data", read_only(self.data))

    @property
    def pixels(self) -> Pixels:
        """The pixels: (height, width) or (height, width, channels), read-only."""
        return self.data() if isinstance(self.data, Deferred) else self.data

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.data.shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.data.shape[1])

    @property
    def is_color(self) -> bool:
        """More than one channel."""
        return len(self.data.shape) == 3

    def _repr_png_(self) -> bytes | None:
        """The picture that a notebook shows: 8 bits, measurements from their least to largest."""
        if not (self.height and self.width):
            return None
        pixels = self.pixels[..., :3] if self.is_color else self.pixels
        if self.encoding in MEASUREMENTS:
            finite = np.where(np.isfinite(pixels), pixels, np.nan)
            low, high = np.nanmin(finite, initial=np.inf), np.nanmax(finite, initial=-np.inf)
            pixels = np.nan_to_num((finite - low) * (255 / max(high - low, 1e-9))).astype(np.uint8)
            pixels = pixels if pixels.shape[2:] in ((), (3,)) else pixels[..., 0]
        elif pixels.dtype == np.uint16:
            pixels = (pixels >> 8).astype(np.uint8)
        order = slice(None, None, -1 if self.encoding.startswith("rgb") else 1)
        shown = np.ascontiguousarray(pixels[..., order] if pixels.ndim == 3 else pixels)
        return cv2.imencode(".png", shown)[1].tobytes()

    def fields(self) -> dict[str, Any]:
        pixels = np.ascontiguousarray(self.pixels)
        return {
            "header": header(self.header),
            "height": self.height,
            "width": self.width,
            "encoding": self.encoding,
            "is_bigendian": int(pixels.itemsize > 1 and sys.byteorder == "big"),
            "step": pixels.nbytes // self.height if self.height else 0,
            "data": pixels.reshape(-1).view(np.uint8),
        }

    @classmethod
    def read(cls, message: Any) -> Image:
        """The image in a sensor_msgs/msg/Image; its pixels are not copied if possible.

        Raises:
            TooLarge: nodes would take too much memory for it.
            ValueError: no pixels, contradictory sizes, or an unknown encoding.
        """
        if not (message.height and message.width):
            raise ValueError(f"an image of {message.width}x{message.height} pixels")
        name = str(message.encoding)
        found = read_header(message.header)
        if name in _YUV422:
            return cls(_yuv422(message, _YUV422[name]), "bgr8", found)
        if name in _PLANES:
            return cls(_planes(message, name), "bgr8", found)
        encoding = _ALSO_CALLED.get(name, name)
        known = ENCODINGS if encoding in ENCODINGS else MEASUREMENTS
        if encoding not in known:
            names = ", ".join((*ENCODINGS, *_ALSO_CALLED, *MEASUREMENTS, *_YUV422, *_PLANES))
            raise ValueError(f"unknown image encoding {name!r}; supported: {names}")
        return cls(_pixels(message, *known[encoding]), encoding, found)


@dataclass(frozen=True, eq=False)
class CompressedImage(TabledMessage):
    """An image as JPEG or PNG; ``format`` is as image_transport writes it."""

    type_name = "sensor_msgs/msg/CompressedImage"
    on_topics = False  # nodes see it as an `Image`
    ros_fields = ros.table(format=str, data=ros.array("data", -1, dtype=np.uint8))

    data: npt.NDArray[np.uint8]
    format: str
    header: Header = Header()


def _pixels(message: Any, dtype: str, channels: int) -> Pixels:
    height, width = int(message.height), int(message.width)
    stored = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    rows = _rows(message, height, width * channels * stored.itemsize)
    shape = (height, width) if channels == 1 else (height, width, channels)
    pixels: Pixels = rows.view(stored).reshape(shape).astype(dtype, copy=False)
    return pixels if pixels.flags.aligned else pixels.copy()


def _rows(message: Any, count: int, row: int) -> Pixels:
    """Bytes of ``count`` rows (count, row), without padding."""
    step = int(message.step)
    flat = np.frombuffer(message.data, np.uint8)
    if step < row or flat.size != step * count:
        if step < row:
            raise ValueError(
                f"a row of {message.width} {message.encoding} pixels needs {row} bytes, but the"
                f" step is {step}"
            )
        size = f"{message.encoding} of {message.width}x{message.height}"
        raise ValueError(
            f"{size} with a step of {step} bytes needs {step * count} bytes, but the message holds"
            f" {flat.size}"
        )
    check_image(message.width, message.height, step // message.width)
    return np.ascontiguousarray(flat.reshape(count, step)[:, :row])


def _yuv422(message: Any, order: str) -> Deferred:
    _need_even(message, message.width)
    packed = _pixels(message, "uint8", 2)
    shape = (*packed.shape[:2], 3)
    return Deferred(shape, np.uint8, partial(yuv422_to_bgr, packed, order))


def _planes(message: Any, name: str) -> Deferred:
    height, width = int(message.height), int(message.width)
    if name == "nv24" and message.step != width:
        raise ValueError(
            f"nv24 of {width} pixels with a step of {message.step} bytes is not supported"
        )
    if name != "nv24":
        _need_even(message, width, height)
    rows = _rows(message, height + height * _PLANES[name] // 2, width)
    return Deferred((height, width, 3), np.uint8, partial(planes_to_bgr, rows, name))


def _need_even(message: Any, *sides: int) -> None:
    if any(side % 2 for side in sides):
        size = f"{message.width}x{message.height}"
        raise ValueError(
            f"{message.encoding} of {size} pixels is not supported: it has an odd number of rows"
            " or columns"
        )


def yuv422_to_bgr(packed: Pixels, order: str) -> Pixels:
    """BGR of two bytes per pixel, where two neighbours share their colour.

    Args:
        packed: (height, width, 2), of an even width.
        order: of the bytes of two pixels, ``UYVY`` or ``YUYV``.
    """
    return cv2.cvtColor(packed, getattr(cv2, f"COLOR_YUV2BGR_{order}"))


def planes_to_bgr(rows: Pixels, kind: str) -> Pixels:
    """BGR of one byte of gray per pixel, and after all of them pairs of bytes for the colours.

    Args:
        rows: of nv12 and nv21 (height * 3/2, width), both even, a pair for 2x2 pixels; of nv24
            (height * 3, width), a pair for each.
        kind: ``nv12``, ``nv21`` or ``nv24``.
    """
    if kind != "nv24":
        return cv2.cvtColor(rows, getattr(cv2, f"COLOR_YUV2BGR_{kind.upper()}"))
    height, width = len(rows) // 3, rows.shape[1]
    gray, colors = rows[:height], rows[height:].reshape(height, 2 * width)
    doubled = np.concatenate([gray.repeat(2, axis=0).repeat(2, axis=1), colors])  # is nv12 then
    return np.ascontiguousarray(cv2.cvtColor(doubled, cv2.COLOR_YUV2BGR_NV12)[::2, ::2])
