"""Landing targets in the axes that autopilots expect.

MAVLink's LANDING_TARGET has the same fields for all autopilots, and each reads one frame of them:
ArduPilot the position relative to the body (MAV_FRAME_BODY_FRD), PX4 the position in its local
frame (MAV_FRAME_LOCAL_NED), which it calls ``x_abs``, ``y_abs``, ``z_abs``.

Source: ArduPilot, AC_PrecLand_MAVLink.cpp; PX4, MavlinkReceiver::handle_message_landing_target.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.localization.estimate import POSE, LandmarkEstimate
from ros_visualise.geometry import rotations


class Autopilot(Enum):
    """Autopilots by the frame of their LANDING_TARGET; ``NONE`` is ROS's: relative to the body,
    with x forward, y left and z up.
    """

    NONE = "none"
    ARDUPILOT = "ardupilot"
    PX4 = "px4"


class RelativePose(NamedTuple):
    """Position (3,), quaternion (4,) and covariance (6, 6) of a target.

    The covariance is of x, y, z, and of rotations about the same axes.
    """

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats


_DOWN = np.diag((1.0, -1.0, -1.0))  # forward, right, down of forward, left, up
_NED_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def relative_to(
    T_fixed_body: Floats, estimate: LandmarkEstimate, autopilot: Autopilot
) -> RelativePose:
    """The target's pose as an autopilot takes it.

    For autopilots the target's own z axis points down too: a target right below that heads as the
    robot does has no rotation in MAV_FRAME_BODY_FRD, nor has one that heads north in
    MAV_FRAME_LOCAL_NED.

    Args:
        T_fixed_body: (4, 4); for PX4, x of the fixed frame points east and y north (REP 103).
        estimate: the target in the fixed frame.
        autopilot: which takes it.
    """
    away = estimate.position_xyz - T_fixed_body[:3, 3]
    own = np.eye(3) if autopilot is Autopilot.NONE else _DOWN
    is_local = autopilot is Autopilot.PX4
    turned = _NED_ENU if is_local else own @ T_fixed_body[:3, :3].T
    position = turned @ (estimate.position_xyz if is_local else away)
    both = np.kron(np.eye(2), turned)
    covariance = both @ estimate.covariance[POSE, POSE] @ both.T
    turn = rotations.from_matrix(turned @ estimate.R_fixed_landmark @ own)
    return RelativePose(position, turn, covariance)
