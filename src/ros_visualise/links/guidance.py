"""Messages for a vehicle: landing targets and poses, in the frames that each autopilot takes.

PX4 takes LANDING_TARGET in MAV_FRAME_LOCAL_NED and ODOMETRY; ArduPilot LANDING_TARGET in
MAV_FRAME_BODY_FRD and VISION_POSITION_ESTIMATE. Other autopilots are sent neither.

Source: PX4, MavlinkReceiver; ArduPilot, AC_PrecLand_MAVLink and GCS_MAVLINK::handle_odometry, which
reads velocities even where they are unknown.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from ros_visualise.data import PoseWithCovarianceStamped
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import to_attitude, to_enu, to_flu
from ros_visualise.links.mavlink import dialect
from ros_visualise.links.telemetry import SIX_ENU, Telemetry

ARDUPILOT, PX4 = 3, 12
"""MAV_AUTOPILOT_ARDUPILOTMEGA, MAV_AUTOPILOT_PX4."""

_LOCAL_NED, _BODY_FRD = 1, 12
_FIDUCIAL = 2  # LANDING_TARGET_TYPE_VISION_FIDUCIAL
_VISION = 2  # MAV_ESTIMATOR_TYPE_VISION
_UPPER = np.triu_indices(6)


def landing_target(
    target: PoseWithCovarianceStamped, autopilot: int, own: Telemetry, stamp_ns: int | None
) -> Any:
    """LANDING_TARGET; None where the vehicle's own pose is needed and unknown, or for NaN.

    Args:
        target: the pose of the node `landing_target`: in a frame ``_ned``, ``_frd``, or relative to
            the body, x forward, y left, z up.
        autopilot: whose frame it gets: `PX4` or `ARDUPILOT`.
        own: the vehicle's poses.
        stamp_ns: time for which the target holds; None: unknown, it is taken to hold now.
    """
    frame, at = target.header.frame_id, np.asarray(target.position_xyz, np.float64)
    is_local = frame.endswith("_ned")
    if not is_local and not frame.endswith("_frd"):
        at = to_flu(at)  # which turns back too
    if is_local is not (autopilot == PX4):
        pose = own.pose_at(stamp_ns)
        if pose is None:
            return None
        position, R = pose
        if is_local:
            at = to_flu(R.T @ (to_enu(at) - position))
        else:
            at = to_enu(position + R @ to_flu(at))
    if not np.isfinite(at).all():
        return None
    x, y, z = at.tolist()
    is_ned = autopilot == PX4
    return dialect().MAVLink_landing_target_message(
        microseconds(stamp_ns),
        target_num=0,
        frame=_LOCAL_NED if is_ned else _BODY_FRD,
        angle_x=0.0 if is_ned else math.atan2(y, z),
        angle_y=0.0 if is_ned else math.atan2(-x, z),
        distance=0.0 if is_ned else math.dist((x, y, z), (0, 0, 0)),
        size_x=0.0,
        size_y=0.0,
        x=x,
        y=y,
        z=z,
        q=(1.0, 0.0, 0.0, 0.0),
        type=_FIDUCIAL,
        position_valid=1,
    )


def microseconds(stamp_ns: int | None) -> int:
    """A time as messages have it, which vehicles convert by TIMESYNC; None: now."""
    return (time.time_ns() if stamp_ns is None else stamp_ns) // 1000


def body_pose(
    estimate: PoseWithCovarianceStamped, autopilot: int, stamp_ns: int | None, resets: int
) -> Any:
    """ODOMETRY or VISION_POSITION_ESTIMATE of the body's pose in a frame x east, y north, z up."""
    usec = microseconds(stamp_ns)
    at = to_enu(estimate.position_xyz)
    turned = SIX_ENU @ estimate.covariance @ SIX_ENU.T
    values = [*at, *np.asarray(estimate.quat_xyzw).tolist(), *turned.ravel()]
    if not np.isfinite(values).all():
        return None
    covariance = turned[_UPPER].tolist()
    x, y, z = at.tolist()
    quat = to_attitude(np.roll(estimate.quat_xyzw, 1))  # which turns back too
    if autopilot == ARDUPILOT:
        roll, pitch, yaw = rotations.to_rpy(quat).tolist()
        return dialect().MAVLink_vision_position_estimate_message(
            usec, x, y, z, roll, pitch, yaw, covariance, resets
        )
    unknown = [math.nan] * 21
    return dialect().MAVLink_odometry_message(
        usec,
        _LOCAL_NED,
        _BODY_FRD,
        x,
        y,
        z,
        np.roll(quat, 1).tolist(),
        *[math.nan] * 6,
        covariance,
        unknown,
        resets,
        _VISION,
    )
