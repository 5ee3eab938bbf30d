"""Landing targets in the robot's body frame, as autopilots expect them."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.landing.tracking import TargetEstimate
from ros_visualise.landmarks.localization.seen import cross


class BodyAxes(Enum):
    """Axes of body and target: forward, left, up, or forward, right, down."""

    FLU = "FLU"
    FRD = "FRD"


class RelativePose(NamedTuple):
    """Position (3,), quaternion (4,) and covariance (6, 6) of a target, in the body's axes.

    The covariance is of x, y, z, and of rotations about the body's axes.
    """

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats


_TURNED = {BodyAxes.FLU: np.eye(3), BodyAxes.FRD: np.diag((1.0, -1.0, -1.0))}


def relative_to(
    T_fixed_body: Floats, estimate: TargetEstimate, attitude_sigma: float, axes: BodyAxes
) -> RelativePose:
    """The target's pose relative to the body.

    With FRD the target's own z axis points down as well. A target right below with the robot's
    heading has no rotation, as in MAVLink's LANDING_TARGET in MAV_FRAME_BODY_FRD.

    Args:
        T_fixed_body: (4, 4).
        estimate: the target in the fixed frame.
        attitude_sigma: standard deviation of the camera's attitude about each axis, radians. It is
            common to all images and therefore not part of the estimate.
        axes: of the result.
    """
    turned = _TURNED[axes]
    to_body = turned @ T_fixed_body[:3, :3].T
    away = to_body @ (estimate.position_xyz - T_fixed_body[:3, 3])
    both = np.kron(np.eye(2), to_body)
    tilted = np.vstack([-cross(away), np.eye(3)])
    covariance = both @ estimate.covariance[:6, :6] @ both.T
    covariance = covariance + attitude_sigma**2 * tilted @ tilted.T
    return RelativePose(away, rotations.from_matrix(to_body @ estimate.R @ turned), covariance)
