"""A barometer."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import FluidPressure, Header
from ros_visualise.simulation.sensors.noise import GaussMarkov, Interval, random_of
from ros_visualise.simulation.settings import QuadrotorParams

_SEA_LEVEL_PA = 101325.0
_SEA_LEVEL_K = 288.15
_LAPSE_K_M = 0.0065
_EXPONENT = 5.25588


def pressure_at(altitude_m: float) -> float:
    """Pressure in pascal of the standard atmosphere. Source: ISO 2533, troposphere."""
    return _SEA_LEVEL_PA * math.pow(1 - _LAPSE_K_M * altitude_m / _SEA_LEVEL_K, _EXPONENT)


class Barometer:
    """Air pressure with a slow error, as from the weather, and white noise."""

    frame_id = "base_link"

    def __init__(self, params: QuadrotorParams, seed: int) -> None:
        self._random = random_of(seed, "barometer")
        self._origin_m = params.gps_altitude
        self._white = params.baro_noise
        drift = np.array([params.baro_drift])
        self._drift, self._interval = (
            GaussMarkov(self._random, drift, params.baro_drift_time),
            Interval(),
        )
        self._variance = params.baro_noise**2 + params.baro_drift**2

    def measure(self, stamp_ns: int, height_m: float) -> FluidPressure:
        """The pressure at a height above the world's origin."""
        drift = float(self._drift.step(self._interval.until(stamp_ns))[0])
        error = drift + self._white * self._random.standard_normal()
        pressure = pressure_at(self._origin_m + height_m) + error
        return FluidPressure(pressure, self._variance, Header(stamp_ns, self.frame_id))
