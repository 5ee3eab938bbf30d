"""How sharp and how noisy the borders of square tags are in an image."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

_ALONG = np.linspace(0.15, 0.85, 16)
_ACROSS_PX = np.linspace(-3, 3, 25)
_SMOOTHED = 0.6  # of the noise is left by interpolation


class Borders(NamedTuple):
    """Of T tags."""

    blur_px: Floats
    """(T,) standard deviation of the blur across the border, 0.53 of the sharpest."""
    noise: Floats
    """(T,) standard deviation of the levels by the difference between black and white."""


TYPICAL = Borders(np.array(0.75), np.array(0.02))
"""Where nobody has looked."""


def borders_of(gray: Pixels, corners_uv: npt.ArrayLike) -> Borders:
    """What the borders of tags look like; `TYPICAL` of one without contrast.

    The blur of an edge between two levels is their difference by its steepest slope and the root
    of two pi. The noise is that along the border, where it varies least.

    Args:
        gray: (height, width) of a depth that OpenCV interpolates: 8 or 16 bits, or floats.
        corners_uv: (T, 4, 2) pixels, in order around each square.
    """
    corners = np.asarray(corners_uv, np.float64).reshape(-1, 4, 2)
    if not len(corners):
        return Borders(np.zeros(0), np.zeros(0))
    levels = _levels(gray, corners)
    profiles = levels.mean(axis=2)
    low, high = np.percentile(profiles.reshape(len(corners), -1), (5, 95), axis=1)
    slopes = np.abs(np.diff(profiles, axis=-1)).max(axis=-1) / np.diff(_ACROSS_PX[:2])
    roughness = np.median(np.percentile(levels.std(axis=2), 10, axis=-1), axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        blur = (high - low) / np.median(slopes, axis=1) / np.sqrt(2 * np.pi)
        noise = roughness / _SMOOTHED / (high - low)
    seen = (high > low) & np.isfinite(blur) & np.isfinite(noise)
    return Borders(np.where(seen, blur, TYPICAL.blur_px), np.where(seen, noise, TYPICAL.noise))


def _levels(gray: Pixels, corners: Floats) -> Floats:
    """Of each tag and side, along and across it: (T, 4, 16, 25)."""
    sides = np.roll(corners, -1, axis=1) - corners
    length = np.maximum(np.linalg.norm(sides, axis=-1, keepdims=True), 1e-9)
    normals = sides[..., ::-1] * [1, -1] / length
    on_border = corners[:, :, None] + sides[:, :, None] * _ALONG[:, None]
    spots = on_border[:, :, :, None] + normals[:, :, None, None] * _ACROSS_PX[:, None]
    u, v = np.moveaxis(spots.reshape(len(corners), -1, 2), -1, 0).astype(np.float32)
    levels = cv2.remap(gray, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    found: Floats = np.asarray(levels, np.float64).reshape(spots.shape[:-1])
    return found
