"""A laser rangefinder that looks down."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Floats, Header, Range
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

FRAME = "range_link"
MOUNT = np.array([0.0, 0.05, -0.05]), (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
"""Position on the body, metres, and attitude: x, the direction of the beam, points down."""
_BEAM_RAD = 0.03

_range = partial(setting, group="rangefinder")


@delivered("range", "rangefinder")
@dataclass(frozen=True)
class RangefinderParams:
    """Parameters of a rangefinder."""

    rangefinder: bool = _range(True, "switch the rangefinder on")
    range_rate: float = _range(20.0, "measurements per second", min=0.1, max=200)
    range_near: float = _range(0.1, "shortest distance, m", min=0, max=10)
    range_far: float = _range(12.0, "longest distance, m", min=0.1, max=1000)
    range_noise: float = _range(
        0.02, "noise of each distance (standard deviation), m", min=0, max=10
    )
    range_scale: float = _range(
        0.005,
        "constant scale error of all distances (standard deviation), as a fraction: 0.01 is 1%",
        min=0,
        max=0.5,
    )


class Rangefinder:
    """Distances with a constant scale error and white noise (REP 117 beyond its limits).

    The variance is that of both, so it grows with the distance.
    """

    def __init__(self, params: RangefinderParams, seed: int) -> None:
        self._random = random_of(seed, "rangefinder")
        self._params = params
        self._scale = 1 + params.range_scale * float(self._random.standard_normal())

    def measure(self, stamp_ns: int, distance_m: float) -> Range:
        """The measured distance for the true one, infinite where there is no surface."""
        p, noise = self._params, float(self._random.standard_normal())
        measured = self._scale * distance_m + p.range_noise * noise
        if measured > p.range_far:
            measured = math.inf
        elif measured < p.range_near:
            measured = -math.inf
        known_m = min(distance_m, p.range_far)
        variance = p.range_noise**2 + (p.range_scale * known_m) ** 2
        limits = p.range_near, p.range_far
        return Range(measured, *limits, _BEAM_RAD, 1, variance, Header(stamp_ns, FRAME))


def distance_below(fitting: Fitting, mount: Floats) -> Callable[[], float]:
    """A function for the true distance along -z of the body to the next surface, metres."""
    mujoco, model, data = load_mujoco(), fitting.model, fitting.data
    body, base = fitting.robot.body, model.body(BASE).id
    met = np.zeros(1, np.int32)

    def distance() -> float:
        axes = body.axes
        origin = np.array(body.position) + axes @ mount
        found = float(mujoco.mj_ray(model, data, origin, -axes[:, 2], None, 1, base, met))
        return found if found >= 0 else math.inf

    return distance


def fit(fitting: Fitting) -> Measure:
    """The sensor under the body."""
    distance, sensor = (
        distance_below(fitting, MOUNT[0]),
        Rangefinder(fitting.settings, fitting.seed),
    )
    return lambda stamp_ns, _: {"range": sensor.measure(stamp_ns, distance())}


SENSOR = SensorType(
    RangefinderParams,
    {"range": Range},
    "range_rate",
    fit,
    "rangefinder",
    always=True,
    standard=False,
    frames={FRAME: MOUNT},
    delivery="range",
)
