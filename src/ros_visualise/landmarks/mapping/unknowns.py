"""What is looked for, and how much is known of it: poses, shared numbers, and noise.

The six numbers of a pose are changes of its position, and a rotation, along and about the axes of
the map. The shared numbers are, in this order, by how many pixels tags are seen too large, by how
much the odometry takes ways for too long, by how much the camera is elsewhere and turned than the
frames tell, along and about its own axes, and by how much all tags are larger than their size.
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

_STEP = 1e-6  # of derivatives by differences

SHARED = 9
LARGER, LONGER, MOUNTING, PRINTED = 0, 1, slice(2, 8), 8
"""Which of the shared numbers is which."""


@dataclass(frozen=True)
class MeasurementNoise:
    """Standard deviations of what is measured.

    Attributes:
        extra_px: what the camera adds to that of corners, which their tag's size tells.
        way_m, tilt_rad, heading_rad: errors of the odometry after a metre; they grow with the root
            of the way.
        still_m, still_rad: what is added between any two views.
    """

    extra_px: float = 0.0
    way_m: float = 0.03
    tilt_rad: float = math.radians(0.1)
    heading_rad: float = math.radians(0.3)
    still_m: float = 1e-3
    still_rad: float = math.radians(0.02)


@dataclass(frozen=True)
class SharedPrior:
    """Standard deviations of the shared numbers; 0: they stay as they are."""

    larger_px: float = 0.5
    longer: float = 0.03
    mounting_m: float = 0.0
    mounting_rad: float = 0.0
    printed: float = 0.0

    @property
    def sigmas(self) -> Floats:
        """(9,)"""
        mounting = [self.mounting_m] * 3 + [self.mounting_rad] * 3
        return np.array([self.larger_px, self.longer, *mounting, self.printed])


UNKNOWN = SharedPrior()
"""But for the camera's mounting, which is as the frames tell."""


class Unknowns(NamedTuple):
    """All that is looked for."""

    views: Poses
    tags: Poses
    shared: Floats

    def moved(self, of_views: Floats, rest: Floats) -> Unknowns:
        """Changed by steps (N, 6) and (D,)."""
        count = len(self.tags.t)
        of_tags = rest[: 6 * count].reshape(count, 6)
        return Unknowns(
            Poses(*moved(*self.views, of_views)),
            Poses(*moved(*self.tags, of_tags)),
            self.shared + rest[6 * count :],
        )


def mounting(shared: Floats) -> tuple[Floats, Floats]:
    """R and t of the camera in the camera's frame as the frames tell it."""
    return turn(shared[MOUNTING][3:]), shared[MOUNTING][:3]


def differences(residuals: Callable[[Floats], Floats], shared: Floats) -> Floats:
    """(N, 6, 9) derivatives by the shared numbers."""
    columns = [
        (residuals(shared + step) - residuals(shared - step)) / (2 * _STEP)
        for step in _STEP * np.eye(SHARED)
    ]
    return np.stack(columns, axis=2)
