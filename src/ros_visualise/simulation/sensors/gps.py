"""A GPS receiver."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.simulation.sensors.noise import GaussMarkov, Interval, random_of
from ros_visualise.simulation.settings import RobotParams

_DIAGONAL_KNOWN = 2  # COVARIANCE_TYPE_DIAGONAL_KNOWN


class GpsSensor:
    """Positions with a slow error, as from satellites and air, and the receiver's white noise."""

    frame_id = "gps_link"

    def __init__(self, params: RobotParams, seed: int) -> None:
        self._random = random_of(seed, "gps")
        axes = np.array([1.0, 1.0, params.gps_vertical])
        self._white = params.gps_noise * axes
        drift = params.gps_drift * axes
        self._drift, self._interval = (
            GaussMarkov(self._random, drift, params.gps_drift_time),
            Interval(),
        )
        self._covariance = np.diag(self._white**2 + drift**2)
        origin = params.gps_latitude, params.gps_longitude, params.gps_altitude
        self._plane = LocalPlane(*origin)

    def measure(self, stamp_ns: int, position_xyz: Floats) -> NavSatFix:
        """The fix of an antenna at a position: metres east, north and up of the world's origin."""
        noise = self._white * self._random.standard_normal(3)
        drift = self._drift.step(self._interval.until(stamp_ns))
        place = position_xyz + noise + drift
        latitude, longitude, altitude = self._plane.from_enu(place).tolist()
        return NavSatFix(
            latitude,
            longitude,
            altitude,
            self._covariance,
            _DIAGONAL_KNOWN,
            header=Header(stamp_ns, self.frame_id),
        )
