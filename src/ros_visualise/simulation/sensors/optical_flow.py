"""An optical flow sensor: a small downward camera with its own gyroscope and rangefinder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Header, TwistWithCovarianceStamped
from ros_visualise.data.header import read_only
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting
from ros_visualise.simulation.sensors.rangefinder import distance_below

FRAME = "flow_link"
MOUNT = np.array([0.0, -0.05, -0.05]), (1.0, 0.0, 0.0, 0.0)
"""Position on the body, metres, and attitude: that of the body."""
UNMEASURED = 1e6
"""Variance of velocities that are not measured."""
_UNMEASURED, _STILL = read_only(UNMEASURED * np.eye(6)), read_only(np.zeros(3))

_flow = partial(setting, group="optical flow")


@delivered("flow", "optical flow")
@dataclass(frozen=True)
class OpticalFlowParams:
    """Parameters of an optical flow sensor."""

    flow: bool = _flow(True, "switch the optical flow sensor on")
    flow_rate: float = _flow(20.0, "measurements per second", min=0.1, max=200)
    flow_near: float = _flow(
        0.1, "shortest distance to the ground at which it works, m", min=0, max=10
    )
    flow_far: float = _flow(
        10.0, "greatest distance to the ground at which it works, m", min=0.1, max=1000
    )
    flow_noise: float = _flow(
        0.02, "noise of the optical flow (standard deviation), rad/s", min=0, max=10
    )
    flow_scale: float = _flow(
        0.02,
        "constant scale error of all velocities (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )


class OpticalFlow:
    """Velocity over the ground along x and y of the body, with a scale error and white noise.

    The flow of the ground in rad/s, less that of rotations by the gyroscope, times the distance. So
    the noise grows with the distance; velocities along z and rotations are not measured.

    Source: Honegger et al., An open source and open hardware embedded metric optical flow CMOS
    camera, 2013.
    """

    def __init__(self, params: OpticalFlowParams, seed: int) -> None:
        self._random = random_of(seed, "optical_flow")
        self._params = params
        self._scale = 1 + params.flow_scale * float(self._random.standard_normal())

    def measure(
        self, stamp_ns: int, velocity: Floats, distance_m: float
    ) -> TwistWithCovarianceStamped | None:
        """The velocity for the true one (3,) in m/s; None too near or too far from the ground."""
        p = self._params
        if not p.flow_near <= distance_m <= p.flow_far:
            return None
        white, (vx, vy, _) = p.flow_noise * distance_m, velocity.tolist()
        n, m = (self._random.standard_normal(2) * white).tolist()
        scaled, scale = (p.flow_scale * vx, p.flow_scale * vy), self._scale
        covariance = _UNMEASURED.copy()
        covariance[0, 0], covariance[1, 1] = white**2 + scaled[0] ** 2, white**2 + scaled[1] ** 2
        covariance[0, 1] = covariance[1, 0] = scaled[0] * scaled[1]
        measured = np.array((scale * vx + n, scale * vy + m, 0.0))
        return TwistWithCovarianceStamped(measured, _STILL, covariance, Header(stamp_ns, FRAME))


def fit(fitting: Fitting) -> Measure:
    """The sensor under the body."""
    body, sensor = fitting.robot.body, OpticalFlow(fitting.settings, fitting.seed)
    place, distance = MOUNT[0].tolist(), distance_below(fitting, MOUNT[0])

    def measure(stamp_ns: int, _: int) -> Mapping[str, Any]:
        linear, angular = body.velocity()
        (wx, wy, wz), (x, y, z) = angular.tolist(), place
        lever = np.array((wy * z - wz * y, wz * x - wx * z, wx * y - wy * x))
        velocity = linear + lever
        found = sensor.measure(stamp_ns, velocity, distance())
        return {} if found is None else {"optical_flow": found}

    return measure


SENSOR = SensorType(
    OpticalFlowParams,
    {"optical_flow": TwistWithCovarianceStamped},
    "flow_rate",
    fit,
    "flow",
    always=True,
    standard=False,
    frames={FRAME: MOUNT},
    delivery="flow",
)
