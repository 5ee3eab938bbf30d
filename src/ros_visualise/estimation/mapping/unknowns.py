"""The unknowns and their priors: poses, shared numbers, and noise.

The six numbers of a pose are changes of its position and a rotation, along and about the axes of
the map. The shared numbers are, in this order: the pixels by which tags appear too large; the scale
error of the odometry; translation and rotation of the camera relative to tf, along and about its
own axes; and the scale error of all tag sizes. Each further camera of a rig adds the pixels by
which tags appear too large in it, and translation and rotation relative to its given pose in the
rig. Each camera whose calibration has a covariance adds the errors of its intrinsics, in units of
the columns of a root of that covariance, so that they are independent, with variance 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.problem import Poses, RigCamera
from ros_visualise.landmarks.pose.refinement import moved, turn

_STEP = 1e-6  # of finite differences

SHARED = 9
LARGER, LONGER, MOUNTING, PRINTED = 0, 1, slice(2, 8), 8
"""Indices of the shared numbers."""


@dataclass(frozen=True)
class MeasurementNoise:
    """Standard deviations of measurements.

    Attributes:
        extra_px: of each camera: additional noise of corners, beside that given by the tag's size.
        views: number of views of a tag that count as one, as the errors of its corners last.
        way_m, tilt_rad, heading_rad: errors of the odometry after one metre; they grow with the
            root of the distance.
        still_m, still_rad: added between any two views.
        survey_position, survey_turn: factors by which those of the survey are larger than given.
    """

    extra_px: Sequence[float] = (0.0,)
    views: float = 1.0
    way_m: float = 0.03
    tilt_rad: float = math.radians(0.1)
    heading_rad: float = math.radians(0.3)
    still_m: float = 1e-3
    still_rad: float = math.radians(0.02)
    survey_position: float = 1.0
    survey_turn: float = 1.0


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
        """(9,) in the order of the shared numbers that all problems have."""
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
        """The same, changed by steps (N, 6), (M, 6) and (G,)."""
        return Unknowns(
            Poses(*moved(*self.views, of_views)),
            Poses(*moved(*self.tags, of_tags)),
            self.shared + of_shared,
        )


class SharedLayout:
    """Indices of the shared numbers of a rig's cameras.

    Attributes:
        count: number of shared numbers.
        larger: of each camera, the index of the pixels by which tags appear too large.
        rig: of each camera but the first, the indices of translation and rotation in the rig.
        intrinsics: of each camera, the indices of the errors of its intrinsics.
    """

    def __init__(self, cameras: Sequence[RigCamera]) -> None:
        self.cameras = cameras
        self.larger, self.rig, self.count = [LARGER], [slice(0, 0)], SHARED
        for _ in cameras[1:]:
            self.larger.append(self.count)
            self.rig.append(slice(self.count + 1, self.count + 7))
            self.count += 7
        self.intrinsics = []
        for one in cameras:
            free = 0 if one.calibration is None else len(one.calibration.covariance)
            self.intrinsics.append(slice(self.count, self.count + free))
            self.count += free

    def mounted(self, shared: Floats) -> Poses:
        """The cameras (C,) in the frame of the first."""
        T = np.array([one.T_first_camera for one in self.cameras])
        off = np.zeros((len(T), 6))
        off[1:] = np.reshape([shared[rows] for rows in self.rig[1:]], (-1, 6))
        return Poses(T[:, :3, :3], T[:, :3, 3]).compose(Poses(turn(off[:, 3:]), off[:, :3]))

    def sigmas(self, prior: SharedPrior) -> Floats:
        """(count,) standard deviations of all shared numbers; 0: fixed."""
        found = np.ones(self.count)
        found[:SHARED] = prior.sigmas
        for one, larger, rig in zip(self.cameras, self.larger, self.rig, strict=True):
            found[larger] = prior.larger_px
            found[rig] = ([one.sigma_m] * 3 + [one.sigma_rad] * 3)[: rig.stop - rig.start]
        return found


def mounting(shared: Floats) -> tuple[Floats, Floats]:
    """R and t of the camera relative to its frame in tf."""
    return turn(shared[MOUNTING][3:]), shared[MOUNTING][:3]


def differences(residuals: Callable[[Floats], Floats], shared: Floats) -> Floats:
    """(N, 6, G) derivatives by the shared numbers; those of the rig's cameras are 0."""
    columns = [
        (residuals(shared + step) - residuals(shared - step)) / (2 * _STEP)
        for step in _STEP * np.eye(SHARED, len(shared))
    ]
    by_first = np.stack(columns, axis=2)
    return np.pad(by_first, ((0, 0), (0, 0), (0, len(shared) - SHARED)))
