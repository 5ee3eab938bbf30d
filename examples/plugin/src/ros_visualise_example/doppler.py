"""A measurement of the navigator: velocity over the ground by a Doppler radar."""

from dataclasses import dataclass

from ros_visualise.estimation.velocity import VelocitySensor
from ros_visualise.nodes import param


@dataclass(frozen=True)
class DopplerErrorParams:
    doppler: bool = param(
        True, "use a Doppler radar, together with an IMU, if available", group="doppler"
    )
    doppler_scale: float = param(
        0.01, "scale error (standard deviation), as a fraction", min=0, max=1, group="doppler"
    )


SENSOR = VelocitySensor("doppler", DopplerErrorParams)
