"""Thresholds: fixed, Otsu's, and adaptive."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import Pixels
from ros_visualise.vision.color import to_gray
from ros_visualise.vision.depth import full_scale, unit


class Threshold(Enum):
    """Use of the pixels on each side of the threshold."""

    OFF = "off"
    TRUNCATE = "truncate"
    BINARY = "binary"
    BINARY_INVERTED = "binary_inverted"
    TO_ZERO = "to_zero"
    TO_ZERO_INVERTED = "to_zero_inverted"
    OTSU = "otsu"
    ADAPTIVE_MEAN = "adaptive_mean"
    ADAPTIVE_GAUSSIAN = "adaptive_gaussian"


_FIXED = {
    Threshold.TRUNCATE: cv2.THRESH_TRUNC,
    Threshold.BINARY: cv2.THRESH_BINARY,
    Threshold.BINARY_INVERTED: cv2.THRESH_BINARY_INV,
    Threshold.TO_ZERO: cv2.THRESH_TOZERO,
    Threshold.TO_ZERO_INVERTED: cv2.THRESH_TOZERO_INV,
}


_BRIGHTEST = 255


def threshold(
    pixels: Pixels,
    order: str,
    mode: Threshold,
    level: int,
    size: int,
    offset: float,
    into: Pixels | None = None,
) -> Pixels:
    """Compare each pixel with a threshold; one that equals it counts as below.

    Args:
        pixels: one or three channels; a fixed threshold holds for each channel by itself, Otsu and
            adaptive make gray of colour first.
        order: of the channels.
        mode: off returns the same array, as does truncate at 255.
        level: the fixed threshold, 0-255.
        size: adaptive: width of the window in pixels; even counts as the next odd.
        offset: adaptive: the threshold is the window's mean less this, 0-255.
        into: for a fixed threshold: an array that may be overwritten with the result, such as the
            pixels themselves.
    """
    if mode is Threshold.OFF or (mode is Threshold.TRUNCATE and level >= _BRIGHTEST):
        return pixels
    if mode in _FIXED:
        return _apply(pixels, level * unit(pixels), _FIXED[mode], into)
    gray = to_gray(pixels, order)
    if mode is Threshold.OTSU:
        return _apply(gray, 0, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    return adaptive(gray, mode is Threshold.ADAPTIVE_GAUSSIAN, size | 1, offset)


def adaptive(gray: Pixels, gaussian: bool, size: int, offset: float) -> Pixels:
    """Full scale where a pixel exceeds the (weighted) mean of its window less the offset."""
    if gray.dtype == np.uint8:
        mean = cv2.ADAPTIVE_THRESH_GAUSSIAN_C if gaussian else cv2.ADAPTIVE_THRESH_MEAN_C
        return cv2.adaptiveThreshold(gray, 255, mean, cv2.THRESH_BINARY, size, offset)
    exact = gray.astype(np.float32)
    if gaussian:
        local = cv2.GaussianBlur(exact, (size, size), 0, borderType=cv2.BORDER_REPLICATE)
    else:
        local = cv2.blur(exact, (size, size), borderType=cv2.BORDER_REPLICATE)
    above: Pixels = exact > local - offset * unit(gray)
    binary: Pixels = above.astype(gray.dtype) * np.array(full_scale(gray), gray.dtype)
    return binary


def _apply(pixels: Pixels, limit: int, kind: int, into: Pixels | None = None) -> Pixels:
    return cv2.threshold(pixels, limit, full_scale(pixels), kind, dst=into)[1]
