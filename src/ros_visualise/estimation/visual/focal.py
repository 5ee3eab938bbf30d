"""The focal length of a camera without a calibration, by its images.

With a wrong one no motion fits quite; so several are tried. A camera that moves straight ahead, or
hardly, fits with many: then a usual one is assumed.

Source: O. Faugeras, Q.-T. Luong, S. Maybank, Camera self-calibration, 1992 (the constraint).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_visualise.data import CameraInfo, Pixels
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings

USUAL = 0.8
"""Focal length of a usual camera, in widths of its image: 64 degrees wide."""
_TRIED = (0.83, 0.55, 1.25, 0.45, 0.68, 1.0, 1.5)
_ENOUGH = 2  # tried without any motion
_AS_GOOD = 1.02  # times the least residual
_WIDEST = 1.6  # ratio of the longest and the shortest that are as good
_LEAST_VIEWS = 6


class FocalLength(NamedTuple):
    """In widths of the image; ``is_estimated``: by the images, else a usual one.

    An estimate can be wrong by half: over flat ground, and straight ahead, hardly anything shows
    the focal length. One of a drive was 22% too short, one of a flight over a plane 32%; the first
    60 and 120 images of one film gave 1.5 and 1.0.
    """

    widths: float
    is_estimated: bool


def find_focal_length(images: Sequence[Pixels]) -> FocalLength:
    """The focal length with which the images fit best."""
    found, is_moving = {}, False
    settings = VisualSettings(corners=150, is_guessed=True)
    for place, widths in enumerate(_TRIED):
        if place == _ENOUGH and not is_moving:
            break
        odometry = VisualOdometry([pinhole(images[0].shape, widths)], None, settings)
        for number, gray in enumerate(images):
            odometry.step(number * 100_000_000, gray)
        is_moving |= odometry.counts["keyframes"] > 0
        if odometry.counts["keyframes"] >= _LEAST_VIEWS and not odometry.counts["losses"]:
            found[widths] = odometry.residual * widths
    if found:
        best = min(found.values())
        good = [widths for widths, off in found.items() if off <= _AS_GOOD * best]
        if max(good) < _WIDEST * min(good):
            return FocalLength(float(np.exp(np.mean(np.log(good)))), True)
    return FocalLength(USUAL, False)


def pinhole(shape: Sequence[int], widths: float) -> CameraInfo:
    """The calibration of a camera without distortion that sees images (H, W)."""
    height, width = shape[:2]
    f = widths * width
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    return CameraInfo(height, width, K)
