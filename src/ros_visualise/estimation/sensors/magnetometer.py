"""Magnetometer: the heading by the Earth's field, which iron nearby disturbs.

Only the horizontal direction counts. It is relative to true north, so it tells a robot's heading in
the map where the map's position on the Earth is known, and otherwise that position's heading.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Floats, MagneticField
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.robot import DATUM, OwnStates, RobotState, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Reading, Sensor

DISTURBANCE = own_states("disturbance of the magnetometer", 1)
"""Error of magnetic north, rad: positive if it is west of where the declination says."""

_WEAK = 0.15  # horizontal part of the field below which it has no direction


@dataclass(frozen=True)
class MagnetometerErrorParams:
    """Parameters of magnetometer errors."""

    magnetometer: bool = param(True, "use a magnetometer if available", group="magnetometer")
    magnetometer_declination: float = param(
        0.0,
        "declination: angle of magnetic north east of true north, degrees",
        min=-180,
        max=180,
        slider=(-30, 30),
        group="magnetometer",
    )
    magnetometer_sigma: float = param(
        1.0,
        "noise of the heading (standard deviation), degrees",
        min=0.01,
        max=90,
        slider=(0.1, 10),
        group="magnetometer",
    )
    magnetometer_disturbance: float = param(
        10.0,
        "slowly varying heading error from nearby iron (standard deviation), degrees",
        min=0.01,
        max=180,
        slider=(0, 45),
        group="magnetometer",
    )
    magnetometer_time: float = param(
        20.0, "time constant of the varying error, seconds", min=0.1, max=1e5, group="magnetometer"
    )


class MagnetometerModel(Sensor):
    """The field (3,) in the sensor's axes; only its heading counts."""

    name, message, params = "magnetometer", MagneticField, MagnetometerErrorParams
    topic = "imu/mag"

    def read(
        self, message: MagneticField, params: MagnetometerErrorParams
    ) -> tuple[Floats, Floats] | str:
        """The field's direction (3,), and the variance of its heading."""
        strength = float(np.linalg.norm(message.field_xyz))
        if not (math.isfinite(strength) and strength > 0):
            return "is not a magnetic field"
        sigma = math.radians(params.magnetometer_sigma)
        return message.field_xyz / strength, np.array([[sigma**2]])

    def states(self, params: MagnetometerErrorParams) -> Mapping[OwnStates, Prior]:
        """The disturbance."""
        sigma = math.radians(params.magnetometer_disturbance)
        return {DISTURBANCE: Prior(sigma, time_s=params.magnetometer_time)}

    def expect(
        self, robot: RobotState, reading: Reading, params: MagnetometerErrorParams
    ) -> Expected | None:
        """The heading of the field in the map, by that of north."""
        x, y, _ = robot.R @ reading.mounting.R @ reading.values
        level = x * x + y * y
        if level < _WEAK**2:
            return None
        datum = math.atan2(robot.datum_R[1, 0], robot.datum_R[0, 0])
        north = datum + math.pi / 2 - math.radians(params.magnetometer_declination)
        off = math.atan2(y, x) - north - robot[DISTURBANCE][0]
        H = np.zeros((1, core()))
        # The heading also depends on the tilt, twice as much where the field is steep. A lasting
        # disturbance would be taken for tilt; so that part counts as disturbance instead.
        H[0, 5] = -1
        H[0, DATUM.stop - 1] = 1
        H[:, DISTURBANCE.rows] = 1
        return Expected(np.array([math.remainder(off, math.tau)]), H, reading.covariance)

    def give_way(self, belief: Belief, residual: Floats, params: MagnetometerErrorParams) -> str:
        """Make the disturbance uncertain."""
        belief.state = belief.state.copy()
        belief.state.inflate(DISTURBANCE.rows, np.multiply.outer(residual, residual))
        return "treating it as disturbed"


SENSOR = MagnetometerModel()
