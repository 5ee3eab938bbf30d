"""Sensors of velocity in their own axes, such as optical flow, with a scale error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ros_visualise.data import Floats, TwistWithCovarianceStamped
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.robot import VELOCITY, OwnStates, RobotState, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Reading, Sensor

_UNKNOWN = 1e3  # variance of velocities that are not measured, m^2/s^2
_LEAST = 1e-8  # m^2/s^2


class VelocitySensor(Sensor):
    """Measured parts of the velocity (3,), m/s, over the ground in the sensor's axes.

    Only an IMU makes velocity a state of its own: without one, the odometry determines it.

    Args:
        name: of the sensor; its parameter ``<name>_scale`` is the deviation of its scale.
    """

    message = TwistWithCovarianceStamped
    needs_imu = True

    def __init__(self, name: str, params: type) -> None:
        self.name = self.topic = name
        self.params = params
        self.scale = own_states(f"scale of {name}", 1)

    def read(self, message: TwistWithCovarianceStamped, params: Any) -> tuple[Floats, Floats] | str:
        """The velocity (3,) and its covariance (3, 3); large for what is not measured."""
        covariance = message.covariance[:3, :3]
        is_number = np.isfinite(message.linear_xyz).all() and np.isfinite(covariance).all()
        if not is_number or (np.diag(covariance) < 0).any():
            return "is not a number"
        return message.linear_xyz, covariance + _LEAST * np.eye(3)

    def states(self, params: Any) -> Mapping[OwnStates, Prior]:
        """The scale error, as a fraction."""
        return {self.scale: Prior(getattr(params, f"{self.name}_scale"))}

    def expect(self, robot: RobotState, reading: Reading, params: Any) -> Expected | None:
        """The velocity of the sensor in its axes, where measured."""
        measured = np.diag(reading.covariance) < _UNKNOWN
        if not measured.any():
            return None
        to_sensor = (robot.R @ reading.mounting.R).T[measured]
        arm = robot.R @ reading.mounting.p
        velocity = robot.v + np.cross(robot.rates, arm)
        factor = 1 + float(robot[self.scale][0])
        expected = to_sensor @ velocity
        H = np.zeros((len(expected), core()))
        H[:, VELOCITY] = factor * to_sensor  # the rest turns with the robot
        H[:, self.scale.rows.start] = expected
        noise = reading.covariance[np.ix_(measured, measured)]
        return Expected(reading.values[measured] - factor * expected, H, noise)

    def give_way(self, belief: Belief, residual: Floats, params: Any) -> str:
        """Make the velocity uncertain."""
        belief.state = belief.state.copy()
        belief.state.inflate(VELOCITY, float(residual @ residual) * np.eye(3))
        return "the velocity is now uncertain"
