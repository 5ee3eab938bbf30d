"""Images, and images as files."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.limits import check_image
from ros_visualise.core.message import Message
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.cameras import CameraInfo
from ros_visualise.data.encodings import ENCODINGS, MEASUREMENTS, Deferred
from ros_visualise.data.fields import header, read_header
from ros_visualise.data.header import Header, Pixels, read_only
from ros_visualise.data.ros_fields import TabledMessage
from ros_visualise.data.yuv import planes_to_bgr, yuv422_to_bgr

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

    type_name: ClassVar[str] = "sensor_msgs/msg/Image"
    has_calibration: ClassVar[bool] = True
    waiting: ClassVar[int] = 1
    plotted: ClassVar[bool] = False

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
            raise ValueError(f"{self.encoding} is not {self.data.dtype} of {self.data.shape}")
        if not isinstance(self.camera_info, CameraInfo | None):
            raise ValueError(f"camera_info is {type(self.camera_info).__name__}, not CameraInfo")
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

    type_name: ClassVar[str] = "sensor_msgs/msg/CompressedImage"
    on_topics: ClassVar[bool] = False  # nodes see it as an `Image`
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        **ros.plain(format=str),
        "data": ros.array("data", -1, dtype=np.uint8),
    }

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
        size = f"{message.encoding} of {message.width}x{message.height}"
        if step < row:
            raise ValueError(f"a row of {size} needs {row} bytes, but its step is {step}")
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
        raise ValueError(f"nv24 of {width} pixels with a step of {message.step} bytes is not read")
    if name != "nv24":
        _need_even(message, width, height)
    rows = _rows(message, height + height * _PLANES[name] // 2, width)
    return Deferred((height, width, 3), np.uint8, partial(planes_to_bgr, rows, name))


def _need_even(message: Any, *sides: int) -> None:
    if any(side % 2 for side in sides):
        size = f"{message.width}x{message.height}"
        raise ValueError(f"{message.encoding} of an odd size, {size} pixels")
