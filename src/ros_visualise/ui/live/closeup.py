"""The values of an image, as they came: of a part, along a line, as a histogram, and as a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.ui.preview import preview
from ros_visualise.vision.color import order_of, to_bgr

_MOST_VALUES = 1 << 18
_ALONG = 2000  # values along a line
_BINS = 256
_FULL = {"uint8": 255.0, "uint16": 65535.0}
_METRES = {"16UC1": 0.001, "32FC1": 1.0}
"""Encodings of depth -> metres of one step.

Source: REP 118.
"""
_NUMBERS = ["0", "1", "2", "3"]


class Closeup(NamedTuple):
    """An answer: facts for JSON, and bytes."""

    facts: Mapping[str, Any]
    body: bytes = b""


def part(image: Image, box: Sequence[float]) -> Closeup:
    """The values of a part: left, top, width, height in pixels; what lies outside is cut off."""
    left, top, width, height = (int(value) for value in box)
    x, y = (max(0, min(at, side)) for at, side in ((left, image.width), (top, image.height)))
    values = image.pixels[y : max(y, top + height), x : max(x, left + width)]
    if values.size > _MOST_VALUES:
        raise RosVisualiseError("too many values; zoom in")
    return _values(image, values, x=x, y=y, width=values.shape[1], height=values.shape[0])


def line(image: Image, ends: Sequence[float]) -> Closeup:
    """The values along a line between two points of the image, x0 y0 x1 y1 in pixels."""
    x0, y0, x1, y1 = ends
    length = float(np.hypot(x1 - x0, y1 - y0))
    at = np.linspace(0, 1, int(np.clip(length, 2, _ALONG)))
    x, y = np.floor(x0 + at * (x1 - x0)).astype(int), np.floor(y0 + at * (y1 - y0)).astype(int)
    inside = (x >= 0) & (y >= 0) & (x < image.width) & (y < image.height)
    found = image.pixels[y[inside], x[inside]]
    return _values(image, found, length=length, at=(at[inside] * length).round(2).tolist())


def histogram(image: Image) -> Closeup:
    """The number of values in each of equal parts of their range, by channel."""
    channels = image.pixels.reshape(image.height, image.width, -1)
    low, high = 0.0, _FULL.get(str(image.pixels.dtype), 1.0)
    missing = image.encoding in MEASUREMENTS
    if missing:
        known = channels[np.isfinite(channels) & (channels != 0)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    counts = []
    for number in range(channels.shape[2]):
        values = channels[..., number]
        values = values[np.isfinite(values) & (values != 0)] if missing else values
        if values.dtype == np.uint8:
            found = cv2.calcHist([values], [0], None, [_BINS], [0, _BINS]).ravel()
        else:
            found = np.histogram(values, _BINS, (low, max(high, low + 1e-12)))[0]
        counts.append([int(count) for count in found])
    return Closeup({"low": low, "high": high, "counts": counts, **_names(image)})


def png(image: Image) -> Closeup:
    """The image as a PNG file: 8 and 16 bits unchanged, measurements in colours."""
    is_measured = image.encoding in MEASUREMENTS and image.encoding != "16UC1"
    done, data = cv2.imencode(".png", preview(image, 2**30) if is_measured else _plain(image))
    if not done:
        raise RosVisualiseError("the image cannot be written as PNG")
    return Closeup({"stamp": str(image.header.stamp_ns)}, data.tobytes())


def _values(image: Image, values: Pixels, **facts: Any) -> Closeup:
    values = np.ascontiguousarray(values)
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    return Closeup({"dtype": str(values.dtype), **facts, **_names(image)}, little.tobytes())


def _names(image: Image) -> dict[str, Any]:
    """The names of the channels, and the metres of one step of a depth."""
    count = image.pixels.shape[2] if image.is_color else 1
    is_color = count > 2 and image.encoding not in MEASUREMENTS
    names = list(f"{order_of(image.encoding)}A"[:count]) if is_color else _NUMBERS[:count]
    names = names if count > 1 else [""]
    return {"names": names, "metres": _METRES.get(image.encoding, 0)}


def _plain(image: Image) -> Pixels:
    """The pixels for OpenCV: gray, BGR or BGRA."""
    pixels = image.pixels
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] == 4 and order_of(image.encoding).startswith("RGB"):
        return cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGRA)
    return pixels if pixels.shape[2] == 4 else to_bgr(pixels, order_of(image.encoding))
