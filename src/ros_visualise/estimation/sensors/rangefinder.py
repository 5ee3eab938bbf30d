"""Rangefinder: the distance to the ground, along the x axis of its frame."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Range
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.robot import POSE, RobotState, core
from ros_visualise.estimation.sensors import Expected, Reading, Sensor
from ros_visualise.estimation.updating import GROUND
from ros_visualise.geometry import se3

_STEEP = 0.5  # sine of the least angle between the beam and the ground


@dataclass(frozen=True)
class RangefinderErrorParams:
    """Parameters of rangefinder errors. The ground is that of `ground_height`."""

    rangefinder: bool = param(True, "use a rangefinder if available", group="rangefinder")
    rangefinder_sigma: float = param(
        0.05,
        "noise (standard deviation) if the rangefinder reports none, m",
        min=1e-3,
        max=10,
        slider=(0.01, 1),
        group="rangefinder",
    )


class RangefinderModel(Sensor):
    """One number: the distance in metres to the ground, which is level."""

    name, message, params = "rangefinder", Range, RangefinderErrorParams
    topic = "range"

    def read(self, message: Range, params: RangefinderErrorParams) -> tuple[Floats, Floats] | str:
        """The distance (1,), inside the sensor's limits."""
        if not message.min_range <= message.range <= message.max_range:
            return "out of its range"
        known = math.isfinite(message.variance) and message.variance > 0
        variance = message.variance if known else params.rangefinder_sigma**2
        return np.array([message.range]), np.array([[variance]])

    def expect(
        self, robot: RobotState, reading: Reading, params: RangefinderErrorParams
    ) -> Expected | None:
        """The distance from the sensor to the ground; None if its beam is too flat."""
        at = robot.p + robot.R @ reading.mounting.p
        beam = robot.R @ reading.mounting.R[:, 0]
        if -beam[2] < _STEEP:
            return None
        # `ground_height` is a parameter of the node, beside those of this sensor
        ground = getattr(params, "ground_height", 0.0) + robot[GROUND][0]
        distance = (ground - at[2]) / beam[2]
        H = np.zeros((1, core()))
        H[:, POSE] = np.hstack([np.eye(3), -se3.cross(at)])[2] / -beam[2]
        H[0, 3:6] += distance * se3.cross(beam)[2] / beam[2]
        H[:, GROUND.rows] = 1 / beam[2]
        return Expected(reading.values - distance, H, reading.covariance)

    def give_way(self, belief: Belief, residual: Floats, params: RangefinderErrorParams) -> str:
        """Make the height of the ground uncertain."""
        belief.state = belief.state.copy()
        belief.state.inflate(GROUND.rows, np.multiply.outer(residual, residual))
        return "the height of the ground is uncertain now"


SENSOR = RangefinderModel()
