"""A magnetometer."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Header, MagneticField
from ros_visualise.simulation.sensors.noise import random_of
from ros_visualise.simulation.settings import QuadrotorParams

_TESLA = 1e-6


class Magnetometer:
    """The Earth's field in the body's axes, with a bias (the body's magnetism) and white noise."""

    frame_id = "imu_link"

    def __init__(self, params: QuadrotorParams, seed: int) -> None:
        self._random = random_of(seed, "magnetometer")
        dip, east = math.radians(params.mag_inclination), math.radians(params.mag_declination)
        level, down = math.cos(dip), math.sin(dip)
        field = np.array([level * math.sin(east), level * math.cos(east), -down])
        self._field_enu = field * params.mag_strength * _TESLA
        self._bias = params.mag_bias * _TESLA * self._random.standard_normal(3)
        self._white = params.mag_noise * _TESLA
        self._covariance = np.eye(3) * self._white**2

    def measure(self, stamp_ns: int, R_map_body: Floats) -> MagneticField:
        """The field measured at an attitude."""
        noise = self._white * self._random.standard_normal(3)
        measured = self._field_enu @ R_map_body + self._bias + noise
        return MagneticField(measured, self._covariance, Header(stamp_ns, self.frame_id))
