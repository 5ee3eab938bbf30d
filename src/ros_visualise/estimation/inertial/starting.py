"""The first estimate of visual-inertial odometry: of a robot at rest.

The specific force is then that of gravity, and the angular velocity is the gyroscope's bias.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.imu import GYRO, ImuBuffer, ImuNoise
from ros_visualise.estimation.inertial.sliding import FORCE_BIAS, MOTION, RATE_BIAS
from ros_visualise.estimation.robot import RobotState
from ros_visualise.vision.tracking import Ids

_TILT = 0.1  # rad, of a robot at rest, before its force is counted
_SPEED = 0.02  # m/s, of a robot at rest


class SeenCorners(NamedTuple):
    """Corners in an image: their numbers (N,), in order, and directions (N, 2) at z = 1.

    ``T_base_camera`` is (4, 4), and ``turning`` (3,) the angular velocity of the camera on the
    robot, rad/s in the camera's axes. ``rolling`` (N, 3): the velocities of the directions, 1/s,
    and their rows in the image, from -1/2 at its top to 1/2.
    """

    stamp_ns: int
    ids: Ids
    rays: Floats
    T_base_camera: Floats
    turning: Floats
    rolling: Floats


class FirstEstimate(NamedTuple):
    """The robot at a time, and the covariance (15, 15) of its pose, velocity and biases."""

    stamp_ns: int
    robot: RobotState
    covariance: Floats


def level(up: Floats) -> Floats:
    """R_map_base (3, 3) of a robot by the direction (3,) that is up, heading along x."""
    up = up / np.linalg.norm(up)
    ahead = np.array([1.0, 0, 0]) if abs(up[0]) < 0.9 else np.array([0, 0, -np.sign(up[0])])
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left)
    return np.stack([np.cross(left, up), left, up])


def start_at_rest(
    imu: ImuBuffer, from_ns: int, to_ns: int, noise: ImuNoise
) -> FirstEstimate | None:
    """The robot at the start of a rest; None if the IMU has a gap."""
    parts = imu.between(from_ns, to_ns)
    if not parts:
        return None
    times = np.array([one.seconds for one in parts])
    rates = times @ np.array([one.rates for one in parts]) / times.sum()
    force = times @ np.array([one.force for one in parts]) / times.sum()
    robot = RobotState(R=level(force)).with_own(GYRO, rates)
    sigmas = np.zeros(15)
    sigmas[[3, 4]], sigmas[MOTION] = _TILT, _SPEED
    sigmas[RATE_BIAS] = noise.gyro / np.sqrt(times.sum()) + 1e-4
    sigmas[FORCE_BIAS] = noise.accel_bias
    return FirstEstimate(from_ns, robot, np.diag(sigmas**2))
