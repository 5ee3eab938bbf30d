"""Previews of images: 8 bits, gray or BGR, scaled to a window's size."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ros_visualise.data import MEASUREMENTS, Image, Pixels
from ros_visualise.vision.color import encoding_of, order_of, to_bgr
from ros_visualise.vision.depth import to_8_bit
from ros_visualise.vision.measurements import to_picture, usual_range

_BRIGHTEN = np.rint(255 * np.sqrt(np.arange(256) / 255)).astype(np.uint8)


def preview(image: Image, size: int) -> Pixels:
    """A preview of an image: (height, width) gray or (height, width, 3) BGR, 8 bits.

    Args:
        image: of any encoding; a Bayer mosaic is shown in gray, depth in colours; see `to_picture`.
        size: of the longer side in pixels; a smaller image keeps its own.
    """
    pixels = image.pixels
    if image.encoding in MEASUREMENTS:
        return to_picture(_pick(pixels, size))
    small = _shrink(pixels, size)
    if small is not pixels and _is_two_valued(pixels):
        small = cv2.LUT(small, _BRIGHTEN)  # or lines of one pixel would all but disappear
    small = to_8_bit(small)
    return small if small.ndim == 2 else to_bgr(small, order_of(image.encoding))


def rgb_preview(image: Image, size: int) -> Pixels:
    """A preview of an image: (height, width, 3) RGB, 8 bits."""
    pixels = preview(image, size)
    return cv2.cvtColor(pixels, cv2.COLOR_GRAY2RGB if pixels.ndim == 2 else cv2.COLOR_BGR2RGB)


def stretched(image: Image) -> Image:
    """The image in 8 bits with its usual values, without outliers, from black to white."""
    pixels = image.pixels
    low, high = usual_range(np.ravel(pixels[::7, ::5])) or (0.0, 0.0)
    slope = 255 / max(high - low, 1e-9)
    scaled = cv2.addWeighted(pixels, slope, pixels, 0, -low * slope, dtype=cv2.CV_8U)
    order = order_of(image.encoding)
    return replace(image, data=scaled, encoding=encoding_of(scaled, order))


def _shrink(pixels: Pixels, size: int) -> Pixels:
    """Shrink by halves first: at 4K seven times as fast as one mean over all pixels."""
    height, width = pixels.shape[:2]
    if max(height, width) <= size:
        return pixels
    while max(height, width) >= 2 * size:
        height, width = max(1, height // 2), max(1, width // 2)
        pixels = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    factor = max(height, width) / size
    shape = max(1, round(width / factor)), max(1, round(height / factor))
    return cv2.resize(pixels, shape, interpolation=cv2.INTER_LINEAR)


def _pick(values: Pixels, size: int) -> Pixels:
    """Take some of the values, not means: between two depths there is often nothing."""
    height, width = values.shape[:2]
    factor = max(height, width) / size
    if factor <= 1:
        return values
    shape = max(1, round(width / factor)), max(1, round(height / factor))
    return cv2.resize(values, shape, interpolation=cv2.INTER_NEAREST)


def _is_two_valued(pixels: Pixels) -> bool:
    """Black and white alone, by a sample of the pixels: edges, masks."""
    if pixels.ndim == 3 or pixels.dtype != np.uint8:
        return False
    sample = pixels[::8, ::5]
    return bool(((sample == 0) | (sample == 255)).all())
