"""Wheel speed: velocity over the ground in the sensor's axes."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.core.params import param
from ros_visualise.estimation.velocity import VelocitySensor


@dataclass(frozen=True)
class WheelSpeedErrorParams:
    """Parameters of wheel speed errors; its noise is that of its messages."""

    wheel_speed: bool = param(
        True, "use wheel speed, if available (only with an IMU)", group="wheel speed"
    )
    wheel_speed_scale: float = param(
        0.03,
        "scale error (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="wheel speed",
    )


SENSOR = VelocitySensor("wheel_speed", WheelSpeedErrorParams)
