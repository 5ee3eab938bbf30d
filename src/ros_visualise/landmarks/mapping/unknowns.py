"""The unknowns and their priors: poses, shared numbers, and noise.

The six numbers of a pose are changes of its position and a rotation, along and about the axes of
the map. The shared numbers are, in this order: the pixels by which tags appear too large; the scale
error of the odometry; translation and rotation of the camera relative to tf, along and about its
own axes; and the scale error of all tag sizes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.mapping.problem import Poses
from ros_visualise.landmarks.pose.refinement import moved, turn

_STEP = 1e-6  # of finite differences

SHARED = 9
LARGER, LONGER, MOUNTING, PRINTED = 0, 1, slice(2, 8), 8
"""Indices of the shared numbers."""


@dataclass(frozen=True)
class MeasurementNoise:
    """Standard deviations of measurements.

    Attributes:
        extra_px: additional noise of corners, beside that given by the tag's size.
        views: number of views of a tag that count as one, as the errors of its corners last.
        way_m, tilt_rad, heading_rad: errors of the odometry after one metre; they grow with the
            root of the distance.
        still_m, still_rad: added between any two views.
    """

    extra_px: float = 0.0
    views: float = 1.0
    way_m: float = 0.03
    tilt_rad: float = math.radians(0.1)
    heading_rad: float = math.radians(0.3)
    still_m: float = 1e-3
    still_rad: float = math.radians(0.02)


@dataclass(frozen=True)
class SharedPrior:
    """Standard deviations of the shared numbers; 0: fixed."""

    larger_px: float = 0.5
    longer: float = 0.03
    mounting_m: float = 0.0
    mounting_rad: float = 0.0
    printed: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """(9,) in the order of the shared numbers."""
        mounting = [self.mounting_m] * 3 + [self.mounting_rad] * 3
        return np.array([self.larger_px, self.longer, *mounting, self.printed])


UNKNOWN = SharedPrior()
"""Everything unknown except the camera's mounting, which agrees with tf."""


class Unknowns(NamedTuple):
    """All unknowns."""

    views: Poses
    tags: Poses
    shared: Floats

    def moved(self, of_views: Floats, of_tags: Floats, of_shared: Floats) -> Unknowns:
        """The same, changed by steps (N, 6), (M, 6) and (9,)."""
        return Unknowns(
            Poses(*moved(*self.views, of_views)),
            Poses(*moved(*self.tags, of_tags)),
            self.shared + of_shared,
        )


def mounting(shared: Floats) -> tuple[Floats, Floats]:
    """R and t of the camera relative to its frame in tf."""
    return turn(shared[MOUNTING][3:]), shared[MOUNTING][:3]


def differences(residuals: Callable[[Floats], Floats], shared: Floats) -> Floats:
    """(N, 6, 9) derivatives by the shared numbers."""
    columns = [
        (residuals(shared + step) - residuals(shared - step)) / (2 * _STEP)
        for step in _STEP * np.eye(SHARED)
    ]
    return np.stack(columns, axis=2)
