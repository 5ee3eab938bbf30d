"""A measurement of the navigator: the distance to a radio anchor (UWB) at a known position."""

import math
from dataclasses import dataclass

import numpy as np

from ros_visualise.core.errors import ParameterError
from ros_visualise.data import Range
from ros_visualise.estimation.robot import POSE, core, own_states
from ros_visualise.estimation.sensors import Expected, Prior, Sensor
from ros_visualise.geometry import se3
from ros_visualise.nodes import param

BIAS = own_states("bias of uwb", 1)  # the robot's state gets one number more, in metres


@dataclass(frozen=True)
class UwbParams:
    uwb: bool = param(True, "use the distance to a UWB anchor if available", group="uwb")
    uwb_anchor: str = param("0, 0, 2", "the anchor's position in the map: x, y, z", group="uwb")
    uwb_sigma: float = param(0.1, "noise (standard deviation), m", min=1e-3, max=10, group="uwb")
    uwb_bias: float = param(0.2, "bias (standard deviation), m", min=0, max=10, group="uwb")

    def __post_init__(self):
        _ = self.anchor

    @property
    def anchor(self):
        try:
            x, y, z = map(float, self.uwb_anchor.split(","))
        except ValueError:
            x = y = z = math.nan
        if not math.isfinite(x + y + z):
            raise ParameterError(f"uwb_anchor={self.uwb_anchor}: give x, y, z: 0, 0, 2")
        return np.array([x, y, z])


class Uwb(Sensor):
    name, message, params, topic = "uwb", Range, UwbParams, "uwb/range"

    def read(self, message, params):
        if not (math.isfinite(message.range) and message.range > 0):
            return "no distance"
        return np.array([message.range]), np.array([[params.uwb_sigma**2]])

    def states(self, params):
        return {BIAS: Prior(params.uwb_bias)}

    def expect(self, robot, reading, params):
        antenna = robot.p + robot.R @ reading.mounting.p
        away = antenna - params.anchor
        distance = np.linalg.norm(away)
        if distance < 0.5:
            return None  # its direction is too uncertain
        H = np.zeros((1, core()))
        H[0, POSE] = away / distance @ np.hstack([np.eye(3), -se3.cross(antenna)])
        H[0, BIAS.rows] = 1
        return Expected(reading.values - distance - robot[BIAS], H, reading.covariance)

    def give_way(self, belief, residual, params):
        belief.state = belief.state.copy()
        belief.state.inflate(BIAS.rows, np.multiply.outer(residual, residual))
        return "its bias is now uncertain"


SENSOR = Uwb()
