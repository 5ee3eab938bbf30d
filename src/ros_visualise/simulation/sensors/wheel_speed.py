"""Speed of the wheels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Header, TwistWithCovarianceStamped
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting
from ros_visualise.simulation.sensors.optical_flow import UNMEASURED

_wheels = partial(setting, group="wheel speed")


@delivered("wheel", "wheel speed")
@dataclass(frozen=True)
class WheelSpeedParams:
    """Parameters of a speed sensor on the wheels."""

    wheel_speed: bool = _wheels(
        False,
        "switch the wheel speed sensor on; as the odometry uses the same wheels, wheel slip"
        " affects both",
    )
    wheel_rate: float = _wheels(20.0, "measurements per second", min=0.1, max=200)
    wheel_noise: float = _wheels(
        0.02, "noise of each speed (standard deviation), m/s", min=0, max=10
    )
    wheel_scale: float = _wheels(
        0.01,
        "constant scale error of all speeds (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )


class WheelSpeed:
    """Forward speed by the wheels, with a constant scale error and white noise.

    Slip is not added: the wheels' rotation comes from the physics, where they slip.
    """

    def __init__(self, params: WheelSpeedParams, seed: int) -> None:
        self._random = random_of(seed, "wheel_speed")
        self._params = params
        self._scale = 1 + params.wheel_scale * float(self._random.standard_normal())

    def measure(self, stamp_ns: int, speed: float) -> TwistWithCovarianceStamped:
        """The speed for that of the wheels, m/s."""
        p, noise = self._params, float(self._random.standard_normal())
        measured = np.array([self._scale * speed + p.wheel_noise * noise, 0.0, 0.0])
        covariance = UNMEASURED * np.eye(6)
        covariance[0, 0] = p.wheel_noise**2 + (p.wheel_scale * speed) ** 2
        return TwistWithCovarianceStamped(measured, np.zeros(3), covariance, Header(stamp_ns, BASE))


def fit(fitting: Fitting) -> Measure:
    """The sensor on the driven wheels."""
    robot, sensor = fitting.robot, WheelSpeed(fitting.settings, fitting.seed)
    return lambda stamp_ns, _: {"wheel_speed": sensor.measure(stamp_ns, robot.wheel_speed)}


SENSOR = SensorType(
    WheelSpeedParams,
    {"wheel_speed": TwistWithCovarianceStamped},
    "wheel_rate",
    fit,
    "wheel_speed",
    always=True,
    standard=False,
    delivery="wheel",
)
