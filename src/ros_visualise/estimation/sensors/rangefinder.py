"""Rangefinder: the distance to the ground, along the x axis of its frame, with a scale error.

Many measurements of one height average their noise, not their scale: without that state the height
would be more certain than any rangefinder is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, Range
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.plates import is_on_plate
from ros_visualise.estimation.robot import POSE, OwnStates, RobotState, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Reading, Sensor
from ros_visualise.estimation.updating import GROUND
from ros_visualise.geometry import se3

SCALE = own_states("scale of the rangefinder", 1)
"""Error of all distances, as a fraction: positive if they are too long."""

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
    rangefinder_scale: float = param(
        0.01,
        "scale error (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
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

    def states(self, params: RangefinderErrorParams) -> Mapping[OwnStates, Prior]:
        """The scale error."""
        return {SCALE: Prior(params.rangefinder_scale)}

    def expect(
        self, robot: RobotState, reading: Reading, params: RangefinderErrorParams
    ) -> Expected | None:
        """The distance from the sensor to the ground; None if its beam is too flat."""
        at, beam = _beam(robot, reading)
        if -beam[2] < _STEEP:
            return None
        distance = (_ground_m(robot, params) - at[2]) / beam[2]
        factor = 1 + float(robot[SCALE][0])
        H = np.zeros((1, core()))
        H[:, POSE] = np.hstack([np.eye(3), -se3.cross(at)])[2] / -beam[2]
        H[0, 3:6] += distance * se3.cross(beam)[2] / beam[2]
        H[:, GROUND.rows] = 1 / beam[2]
        H *= factor
        H[:, SCALE.rows] = distance
        return Expected(reading.values - factor * distance, H, reading.covariance)

    def is_of_another(
        self, belief: Belief, reading: Reading, params: RangefinderErrorParams
    ) -> bool:
        """True if the beam ends on a plate above the ground, such as a landing pad."""
        at, beam = _beam(belief.state.robot, reading)
        end, ground_m = at + reading.values[0] * beam, _ground_m(belief.state.robot, params)
        return is_on_plate(belief, end, ground_m)

    def give_way(self, belief: Belief, residual: Floats, params: RangefinderErrorParams) -> str:
        """Make the height of the ground uncertain."""
        belief.state = belief.state.copy()
        belief.state.inflate(GROUND.rows, np.multiply.outer(residual, residual))
        return "the height of the ground is now uncertain"


def _beam(robot: RobotState, reading: Reading) -> tuple[Floats, Floats]:
    """Beginning and direction of the beam, (3,) each."""
    return robot.p + robot.R @ reading.mounting.p, robot.R @ reading.mounting.R[:, 0]


def _ground_m(robot: RobotState, params: RangefinderErrorParams) -> float:
    # `ground_height` is a parameter of the node, beside those of this sensor
    return float(getattr(params, "ground_height", 0.0) + robot[GROUND][0])


SENSOR = RangefinderModel()
