"""A barometer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import FluidPressure, Header
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import GaussMarkov, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_SEA_LEVEL_PA = 101325.0
_SEA_LEVEL_K = 288.15
_LAPSE_K_M = 0.0065
_EXPONENT = 5.25588

_barometer = partial(setting, group="barometer")


def pressure_at(altitude_m: float) -> float:
    """Pressure in pascal of the standard atmosphere. Source: ISO 2533, troposphere."""
    return _SEA_LEVEL_PA * math.pow(1 - _LAPSE_K_M * altitude_m / _SEA_LEVEL_K, _EXPONENT)


@delivered("baro", "barometer")
@dataclass(frozen=True)
class BarometerParams:
    """Parameters of a barometer."""

    baro_rate: float = _barometer(25.0, "measurements per second", min=1, max=200)
    baro_noise: float = _barometer(1.5, "noise (standard deviation), Pa", min=0, max=1000)
    baro_drift: float = _barometer(
        8.0, "slowly varying error caused by weather (standard deviation), Pa", min=0, max=1000
    )
    baro_drift_time: float = _barometer(
        300.0, "time constant of the varying error, seconds", min=0.1, max=1e5
    )


class Barometer:
    """Air pressure with a slow error, such as weather, and white noise.

    Args:
        origin_m: altitude of the world's origin.
    """

    frame_id = "base_link"

    def __init__(self, params: BarometerParams, origin_m: float, seed: int) -> None:
        self._random = random_of(seed, "barometer")
        self._origin_m = origin_m
        self._white = params.baro_noise
        drift = np.array([params.baro_drift])
        self._drift = GaussMarkov(self._random, drift, params.baro_drift_time)
        self._variance = params.baro_noise**2 + params.baro_drift**2

    def measure(self, stamp_ns: int, height_m: float) -> FluidPressure:
        """The pressure at a height above the world's origin."""
        drift = float(self._drift.at(stamp_ns)[0])
        error = drift + self._white * self._random.standard_normal()
        pressure = pressure_at(self._origin_m + height_m) + error
        return FluidPressure(pressure, self._variance, Header(stamp_ns, self.frame_id))


def fit(fitting: Fitting) -> Measure:
    """The sensor in the body."""
    body, settings = fitting.robot.body, fitting.settings
    barometer = Barometer(settings, settings.gps_altitude, fitting.seed)
    return lambda stamp_ns, _: {"pressure": barometer.measure(stamp_ns, body.position[2])}


SENSOR = SensorType(
    BarometerParams,
    {"pressure": FluidPressure},
    "baro_rate",
    fit,
    always=True,
    standard=False,
    delivery="baro",
)
