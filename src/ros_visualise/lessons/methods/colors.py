"""8-bit colours identical to OpenCV's: gray, and hue, saturation and value.

Source: OpenCV, imgproc/src/color_rgb and color_hsv: fixed-point numbers, the same on every machine.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Pixels

GRAY_WEIGHTS = {"R": 0.299, "G": 0.587, "B": 0.114}
"""Weights of ITU-R BT.601: the eye sees green best."""

_BITS = 15
_SHIFT = 12


def to_gray(bgr: Pixels) -> Pixels:
    """0.299 R + 0.587 G + 0.114 B, (height, width), 8 bits."""
    blue, green, red = np.moveaxis(bgr.astype(np.int64), -1, 0)
    r, g = (round(GRAY_WEIGHTS[name] * (1 << _BITS)) for name in "RG")
    b = (1 << _BITS) - r - g
    half = 1 << (_BITS - 1)
    gray: Pixels = ((r * red + g * green + b * blue + half) >> _BITS).astype(np.uint8)
    return gray


def to_hsv(bgr: Pixels) -> Pixels:
    """Hue 0-179 (degrees / 2), saturation 0-255, value 0-255: (height, width, 3), 8 bits."""
    blue, green, red = np.moveaxis(bgr.astype(np.int64), -1, 0)
    value = np.maximum(np.maximum(blue, green), red)
    chroma = value - np.minimum(np.minimum(blue, green), red)
    half = 1 << (_SHIFT - 1)
    saturation = (chroma * _reciprocals(255.0)[value] + half) >> _SHIFT
    sector = np.where(
        value == red,
        green - blue,
        np.where(value == green, blue - red + 2 * chroma, red - green + 4 * chroma),
    )
    hue = (sector * _reciprocals(180 / 6)[chroma] + half) >> _SHIFT
    hue = np.where(hue < 0, hue + 180, hue)
    hsv: Pixels = np.stack([hue, saturation, value], axis=-1).astype(np.uint8)
    return hsv


def _reciprocals(scale: float) -> npt.NDArray[np.int64]:
    """scale / n for n from 0 to 255, in fixed point; 0 for 0."""
    numbers = np.arange(1, 256)
    found = np.rint((scale * (1 << _SHIFT)) / numbers).astype(np.int64)
    return np.concatenate([[0], found])
