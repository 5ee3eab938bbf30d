"""Brightness, contrast and histograms."""

from __future__ import annotations

from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import Pixels
from ros_visualise.vision.color import on_luma
from ros_visualise.vision.depth import full_scale, unit


class Equalize(Enum):
    """Method of equalization."""

    OFF = "off"
    GLOBAL = "global"
    CLAHE = "clahe"


def adjust(pixels: Pixels, contrast: float, brightness: int) -> Pixels:
    """contrast x pixels + brightness (-255 to 255), saturated; 1 and 0 are off."""
    if contrast == 1 and brightness == 0:
        return pixels
    return cv2.addWeighted(pixels, contrast, pixels, 0, brightness * unit(pixels))


def equalize(pixels: Pixels, order: str, mode: Equalize, clip: float, tiles: int) -> Pixels:
    """Spread the histogram of gray, or of a colour image's luma.

    Args:
        pixels: one or three channels.
        order: of the channels.
        mode: off returns the same array.
        clip: CLAHE's contrast limit, in multiples of the mean height of the histogram; 0: none.
        tiles: CLAHE's number of tiles along each side.
    """
    if mode is Equalize.GLOBAL:
        return on_luma(equalize_histogram, pixels, order)
    if mode is Equalize.CLAHE:
        return on_luma(cv2.createCLAHE(clip, (tiles, tiles)).apply, pixels, order)
    return pixels


def equalize_histogram(gray: Pixels) -> Pixels:
    """Map values by their cumulative histogram; the darkest one becomes 0."""
    if gray.dtype == np.uint8:
        return cv2.equalizeHist(gray)
    cumulative = np.bincount(gray.ravel(), minlength=65536).cumsum()
    below = cumulative[gray.min()]
    if below == gray.size:
        return gray
    levels = np.rint((cumulative - below) * (full_scale(gray) / (gray.size - below)))
    table: Pixels = levels.clip(0).astype(gray.dtype)
    return table[gray]
