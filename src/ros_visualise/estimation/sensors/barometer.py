"""Barometer: the height by the air's pressure, with an offset that drifts with the weather."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, FluidPressure
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.robot import POSE, OwnStates, RobotState, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Reading, Sensor
from ros_visualise.geometry import se3

OFFSET = own_states("offset of the barometer", 1)
"""Error of its height, metres: positive if it shows too little."""

_UNKNOWN_M = 5000.0
_SEA_LEVEL_PA, _SEA_LEVEL_K, _LAPSE_K_M, _EXPONENT = 101325.0, 288.15, 0.0065, 5.25588


@dataclass(frozen=True)
class BarometerErrorParams:
    """Parameters of barometer errors."""

    barometer: bool = param(True, "use a barometer if available", group="barometer")
    barometer_sigma: float = param(
        0.3,
        "noise (standard deviation) if the barometer reports none, m",
        min=1e-3,
        max=100,
        slider=(0.01, 5),
        group="barometer",
    )
    barometer_walk: float = param(
        0.1,
        "drift with the weather (standard deviation), m/sqrt(s)",
        min=0,
        max=10,
        slider=(0, 1),
        group="barometer",
    )


class BarometerModel(Sensor):
    """One number: the height in metres of the standard atmosphere."""

    name, message, params = "barometer", FluidPressure, BarometerErrorParams
    topic = "pressure"

    def read(
        self, message: FluidPressure, params: BarometerErrorParams
    ) -> tuple[Floats, Floats] | str:
        """The height (1,) of a pressure. Source: ISO 2533, troposphere."""
        if not 1e3 < message.pressure < 2e5:
            return "is not an air pressure"
        ratio = math.pow(message.pressure / _SEA_LEVEL_PA, 1 / _EXPONENT)
        height = _SEA_LEVEL_K / _LAPSE_K_M * (1 - ratio)
        by_pascal = _SEA_LEVEL_K / _LAPSE_K_M * ratio / _EXPONENT / message.pressure
        is_known = math.isfinite(message.variance) and message.variance > 0
        sigma = by_pascal * math.sqrt(message.variance) if is_known else params.barometer_sigma
        return np.array([height]), np.array([[sigma**2]])

    def states(self, params: BarometerErrorParams) -> Mapping[OwnStates, Prior]:
        """The offset."""
        return {OFFSET: Prior(_UNKNOWN_M, params.barometer_walk)}

    def expect(self, robot: RobotState, reading: Reading, params: BarometerErrorParams) -> Expected:
        """The sensor's height above the map's origin, less the offset."""
        at = robot.p + robot.R @ reading.mounting.p
        H = np.zeros((1, core()))
        H[:, POSE] = np.hstack([np.eye(3), -se3.cross(at)])[2]
        H[:, OFFSET.rows] = -1
        residual = reading.values - at[2] + robot[OFFSET]
        return Expected(residual, H, reading.covariance)

    def give_way(self, belief: Belief, residual: Floats, params: BarometerErrorParams) -> str:
        """Make the offset uncertain."""
        belief.state = belief.state.copy()
        belief.state.inflate(OFFSET.rows, np.multiply.outer(residual, residual))
        return "its offset is now uncertain"


SENSOR = BarometerModel()
