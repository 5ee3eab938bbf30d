"""Errors of its motion that an odometry reports in its messages."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats, Odometry
from ros_visualise.geometry import rotations, se3

_UNKNOWN = 1e3  # variance above which an odometry says that it does not know


def reported_variances(odometry: Odometry, last: Odometry | None) -> Floats:
    """(4,) variances of velocity and yaw rate, as an odometry reports them; 0 if it does not.

    Where it does not report them for the velocity, or as unknown, those of its pose count by what
    they have grown since the last message: an odometry by eye that is lost reports them so.
    """
    values = np.diag(odometry.twist_covariance)[[0, 1, 2, 5]]
    known = np.isfinite(values) & (values > 0) & (values < _UNKNOWN)
    if known.all() or last is None:
        return np.where(known, values, 0.0)
    return np.where(known, values, _growth(odometry, last))


def _growth(odometry: Odometry, last: Odometry) -> Floats:
    """(4,) growth of the covariance of a pose as that of velocities; at least 0.

    It is that of the twists: a heading error alone does not grow while the robot moves.
    """
    seconds = (odometry.header.stamp_ns - last.header.stamp_ns) / 1e9
    both = (odometry.pose_covariance, odometry), (last.pose_covariance, last)
    if seconds <= 0 or not all(np.isfinite(one).all() for one, _ in both):
        return np.zeros(4)
    now, before = (
        change @ covariance @ change.T
        for covariance, one in both
        for change in (se3.about_origin(one.position_xyz),)
    )
    here = se3.about_itself(odometry.position_xyz)
    grown = here @ (now - before) @ here.T
    R = rotations.to_matrix(odometry.quat_xyzw)
    linear, angular = (np.diag(R.T @ grown[part, part] @ R) for part in (slice(3), slice(3, 6)))
    values: Floats = np.maximum([*linear, angular[2]], 0.0) / seconds**2
    return values
