"""Blurring and sharpening; an even kernel size counts as the next odd one."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import Pixels
from ros_visualise.vision.depth import to_8_bit, unit


class Blur(Enum):
    """Method of smoothing."""

    OFF = "off"
    GAUSSIAN = "gaussian"
    MEDIAN = "median"
    BILATERAL = "bilateral"


def blur(pixels: Pixels, mode: Blur, size: int, sigma: float, sigma_color: float) -> Pixels:
    """Blur each channel with a window of ``size`` pixels.

    Args:
        pixels: one or three channels.
        mode: off returns the same array.
        size: width of the window.
        sigma: standard deviation in pixels (not for the median); 0 takes it from the size.
        sigma_color: bilateral: the difference of values, 0-255, that still mixes.
    """
    size |= 1
    if mode is Blur.GAUSSIAN:
        return cv2.GaussianBlur(pixels, (size, size), sigma)
    if mode is Blur.MEDIAN:
        return median(pixels, size)
    if mode is Blur.BILATERAL:
        return bilateral(pixels, size, sigma_color * unit(pixels), sigma or sigma_of(size))
    return pixels


def sigma_of(size: int) -> float:
    """The standard deviation that OpenCV gives to a Gaussian of that size (binomial up to 7)."""
    return 0.3 * ((size - 1) * 0.5 - 1) + 0.8


def median(pixels: Pixels, size: int) -> Pixels:
    """The median of each window; above size 5 a 16-bit image is reduced to 256 levels for it."""
    if pixels.dtype == np.uint8 or size <= 5:
        return cv2.medianBlur(pixels, size)
    return np.multiply(cv2.medianBlur(to_8_bit(pixels), size), 257, dtype=np.uint16)


def bilateral(pixels: Pixels, size: int, sigma_color: float, sigma_space: float) -> Pixels:
    """Blur that keeps edges (Tomasi and Manduchi, 1998); at 16 bits by way of float32."""
    if pixels.dtype == np.uint8:
        return cv2.bilateralFilter(pixels, size, sigma_color, sigma_space)
    exact = cv2.bilateralFilter(pixels.astype(np.float32), size, sigma_color, sigma_space)
    return np.rint(exact).clip(0, 65535).astype(np.uint16)


def sharpen(pixels: Pixels, amount: float, sigma: float) -> Pixels:
    """Unsharp mask: pixels + amount x (pixels - Gaussian of them); amount 0 is off."""
    if amount == 0:
        return pixels
    smooth = cv2.GaussianBlur(pixels, (0, 0), sigma)
    return cv2.addWeighted(pixels, 1 + amount, smooth, -amount, 0)
