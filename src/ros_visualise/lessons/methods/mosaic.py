"""A Bayer mosaic, and demosaicing by averaging neighbours."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

PATTERN = "rggb"
"""The colours of the 2x2 pixels at the top left, in reading order."""

_CHANNELS = {"b": 0, "g": 1, "r": 2}


def channel_map(height: int, width: int) -> Pixels:
    """Channel of BGR measured by each pixel of the sensor, (height, width)."""
    tile = np.array([_CHANNELS[letter] for letter in PATTERN], np.uint8).reshape(2, 2)
    return np.tile(tile, (-(-height // 2), -(-width // 2)))[:height, :width]


def to_mosaic(bgr: Pixels) -> Pixels:
    """Measurements of a sensor with that filter pattern: one number for each pixel."""
    kinds = channel_map(*bgr.shape[:2])
    return np.ascontiguousarray(np.take_along_axis(bgr, kinds[..., None], 2)[..., 0])


def colored(mosaic: Pixels) -> Pixels:
    """A mosaic in BGR, each pixel in the colour of its filter."""
    kinds = channel_map(*mosaic.shape)
    return np.where(kinds[..., None] == np.arange(3), mosaic[..., None], np.uint8(0))


def bilinear(mosaic: Pixels) -> Pixels:
    """BGR by averaging the nearest pixels that measured a colour, rounded half up.

    The outermost pixels, which lack neighbours, get the colours of those beside them.
    """
    kinds = channel_map(*mosaic.shape)
    filled = [_filled(mosaic, kinds == channel) for channel in range(3)]
    inner = np.stack(filled, axis=-1)[1:-1, 1:-1]
    return np.pad(inner, ((1, 1), (1, 1), (0, 0)), mode="edge")


METHODS = {
    "bilinear": cv2.COLOR_BayerRGGB2BGR,
    "VNG": cv2.COLOR_BayerRGGB2BGR_VNG,
    "edge-aware": cv2.COLOR_BayerRGGB2BGR_EA,
}
"""OpenCV's demosaicing methods."""


def demosaic(mosaic: Pixels, method: str) -> Pixels:
    """BGR by one of `METHODS`."""
    return cv2.cvtColor(mosaic, METHODS[method])


def _filled(mosaic: Pixels, is_measured: Pixels) -> Pixels:
    """One colour everywhere: measured, or the mean of the nearest measured pixels.

    Of the eight neighbours, those at the sides are used before those at the corners.
    """
    values = np.where(is_measured, mosaic, 0).astype(np.float64)
    side = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float64)
    corner = np.array([[1, 0, 1], [0, 0, 0], [1, 0, 1]], np.float64)
    beside, at_corner = (_mean(values, is_measured, kernel) for kernel in (side, corner))
    found = np.where(is_measured, mosaic, np.where(np.isnan(beside), at_corner, beside))
    filled: Pixels = np.floor(np.nan_to_num(found) + 0.5).astype(np.uint8)
    return filled


def _mean(values: Floats, is_measured: Pixels, kernel: Floats) -> Floats:
    """Mean of the measured neighbours; NaN without any."""
    border = cv2.BORDER_CONSTANT
    sums = cv2.filter2D(values, -1, kernel, borderType=border)
    counts = cv2.filter2D(is_measured.astype(np.float64), -1, kernel, borderType=border)
    mean: Floats = np.divide(sums, counts, out=np.full(values.shape, np.nan), where=counts > 0)
    return mean
