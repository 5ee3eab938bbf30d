"""Images and calibrations <-> messages of sensor_msgs."""

from __future__ import annotations

import sys
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import (
    ENCODINGS,
    MEASUREMENTS,
    CameraInfo,
    CompressedImage,
    Deferred,
    Image,
    Pixels,
)
from ros_visualise.limits import check_image
from ros_visualise.messages.build import Fields, field, header, read_header
from ros_visualise.vision.color import planes_to_bgr, yuv422_to_bgr

_ALSO_CALLED = {
    "8UC1": "mono8",
    "8UC3": "bgr8",
    "8UC4": "bgra8",
    "16UC3": "bgr16",
    "16UC4": "bgra16",
}
"""OpenCV's own names, which say nothing of colours -> what is taken for them; 16UC1 is depth."""

_YUV422 = {"yuv422": "UYVY", "uyvy": "UYVY", "yuv422_yuy2": "YUYV", "yuyv": "YUYV"}
"""What many cameras send -> the order of its bytes. They are read as bgr8."""

_PLANES = {"nv12": 1, "nv21": 1, "nv24": 4}
"""All gray, then all colours -> bytes of colours for two of gray. They are read as bgr8 too."""


def write_image(image: Image) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/Image, with the pixels as they lie in memory."""
    pixels = np.ascontiguousarray(image.pixels)
    return {
        "header": header(image.header),
        "height": image.height,
        "width": image.width,
        "encoding": image.encoding,
        "is_bigendian": int(pixels.itemsize > 1 and sys.byteorder == "big"),
        "step": pixels.nbytes // image.height if image.height else 0,
        "data": pixels.reshape(-1).view(np.uint8),
    }


def read_image(message: Any) -> Image:
    """The image in a sensor_msgs/msg/Image; its pixels are the message's own where they can be.

    Raises:
        TooLarge: nodes would take too much memory for it.
        ValueError: it has no pixels, its sizes contradict one another, or nobody knows its
            encoding.
    """
    if not (message.height and message.width):
        raise ValueError(f"an image of {message.width}x{message.height} pixels")
    check_image(message.width, message.height, message.step // message.width)
    name = str(message.encoding)
    found = read_header(message.header)
    if name in _YUV422:
        return Image(_yuv422(message, _YUV422[name]), "bgr8", found)
    if name in _PLANES:
        return Image(_planes(message, name), "bgr8", found)
    encoding = _ALSO_CALLED.get(name, name)
    known = ENCODINGS if encoding in ENCODINGS else MEASUREMENTS
    if encoding not in known:
        names = ", ".join((*ENCODINGS, *_ALSO_CALLED, *MEASUREMENTS, *_YUV422, *_PLANES))
        raise ValueError(f"unknown image encoding {name!r}; known are {names}")
    return Image(_pixels(message, *known[encoding]), encoding, found)


def _pixels(message: Any, dtype: str, channels: int) -> Pixels:
    height, width = int(message.height), int(message.width)
    stored = np.dtype(dtype).newbyteorder(">" if message.is_bigendian else "<")
    rows = _rows(message, height, width * channels * stored.itemsize)
    shape = (height, width) if channels == 1 else (height, width, channels)
    pixels: Pixels = rows.view(stored).reshape(shape).astype(dtype, copy=False)
    return pixels if pixels.flags.aligned else pixels.copy()


def _rows(message: Any, count: int, row: int) -> Pixels:
    """The bytes of ``count`` rows (count, row), without what is beyond ``row`` bytes in each."""
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


def write_compressed(image: CompressedImage) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/CompressedImage."""
    return {"header": header(image.header), "format": image.format, "data": image.data}


def read_compressed(message: Any) -> CompressedImage:
    """The compressed image in a sensor_msgs/msg/CompressedImage."""
    data = np.frombuffer(message.data, np.uint8)
    return CompressedImage(data, str(message.format), read_header(message.header))


def write_camera_info(info: CameraInfo) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/CameraInfo."""
    P = np.column_stack([info.K, np.zeros(3)]) if info.P is None else info.P
    matrices = {"d": info.D, "k": info.K, "r": info.R, "p": P}
    whole_image = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 0)
    return {
        "header": header(info.header),
        "height": info.height,
        "width": info.width,
        "distortion_model": info.distortion_model,
        **{name: np.asarray(m, np.float64).ravel() for name, m in matrices.items()},
        "binning_x": 0,
        "binning_y": 0,
        "roi": Fields("sensor_msgs/msg/RegionOfInterest", {**whole_image, "do_rectify": False}),
    }


def read_camera_info(message: Any) -> CameraInfo:
    """The calibration in a sensor_msgs/msg/CameraInfo."""

    def matrix(name: str, *shape: int) -> Any:
        return np.array(field(message, name), np.float64).reshape(shape)

    return CameraInfo(
        height=int(message.height),
        width=int(message.width),
        K=matrix("k", 3, 3),
        D=matrix("d", -1),
        R=matrix("r", 3, 3),
        P=matrix("p", 3, 4),
        distortion_model=str(message.distortion_model),
        header=read_header(message.header),
    )
