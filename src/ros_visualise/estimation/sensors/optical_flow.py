"""Optical flow: velocity over the ground in the sensor's axes."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.core.params import param
from ros_visualise.estimation.velocity import VelocitySensor


@dataclass(frozen=True)
class OpticalFlowErrorParams:
    """Parameters of optical flow errors; its noise is that of its messages."""

    optical_flow: bool = param(
        True, "use optical flow, if available (only with an IMU)", group="optical flow"
    )
    optical_flow_scale: float = param(
        0.03,
        "scale error (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=1,
        slider=(0, 0.1),
        group="optical flow",
    )


SENSOR = VelocitySensor("optical_flow", OpticalFlowErrorParams)
