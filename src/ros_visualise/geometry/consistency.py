"""Whether an estimated pose is as far from the truth as its covariance says."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations

NEES_BAND = (1.2373, 14.4494)
"""95 of 100 NEES of honest poses lie between: quantiles of chi-square with 6 degrees of freedom."""

_SMALL = 1e-9  # of a quaternion's sine: below it, the rotation vector is twice its imaginary part


def pose_error(
    position_xyz: Floats, quat_xyzw: Floats, true_xyz: Floats, true_xyzw: Floats
) -> Floats:
    """By how much a pose is wrong (6,), as ROS's covariances count it.

    Metres along the frame's x, y and z, and radians about them: the vector of the rotation that
    leads from the true attitude to the estimated one.
    """
    turn = rotations.multiply(quat_xyzw, rotations.inverse(true_xyzw))
    turn = rotations.normalise(turn * (1 if turn[3] >= 0 else -1))
    sine = float(np.linalg.norm(turn[:3]))
    angle_by_sine = 2 * np.arctan2(sine, turn[3]) / sine if sine > _SMALL else 2.0
    return np.concatenate([position_xyz - true_xyz, turn[:3] * angle_by_sine])


def nees(error: Floats, covariance: Floats) -> float | None:
    """The normalised estimation error squared; None where the covariance (6, 6) says nothing.

    Of honest poses it is 6 on average, and inside `NEES_BAND` 95 times of 100; above that the
    estimate is too sure of itself, below too modest.

    Source: Y. Bar-Shalom et al., Estimation with Applications to Tracking and Navigation (2001),
    section 5.4.2.
    """
    try:
        squared = float(error @ np.linalg.solve(covariance, error))
    except np.linalg.LinAlgError:
        return None
    return squared if np.isfinite(squared) and squared >= 0 else None
