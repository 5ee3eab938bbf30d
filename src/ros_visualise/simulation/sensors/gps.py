"""A GPS receiver."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.simulation.sensors.noise import Drift, random_of
from ros_visualise.simulation.settings import RobotParams

_EQUATOR_M = 6378137.0  # WGS 84
_FLATTENING = 1 / 298.257223563
_DIAGONAL_KNOWN = 2  # COVARIANCE_TYPE_DIAGONAL_KNOWN


class GpsSensor:
    """A slow error of the satellites and the air, and white noise of the receiver.

    Metres become degrees by the ellipsoid's radii of curvature at the world's origin, which a
    kilometre away is right to a decimetre.
    """

    frame_id = "gps_link"

    def __init__(self, params: RobotParams, seed: int) -> None:
        self._random = random_of(seed, "gps")
        axes = np.array([1.0, 1.0, params.gps_vertical])
        self._white = params.gps_noise * axes
        drift = params.gps_drift * axes
        period_s = 1 / params.gps_rate
        self._drift = Drift(self._random, drift, params.gps_drift_time, period_s)
        self._covariance = np.diag(self._white**2 + drift**2)
        self._origin = params.gps_latitude, params.gps_longitude, params.gps_altitude
        self._degrees = _degrees_per_metre(params.gps_latitude, params.gps_altitude)

    def measure(self, stamp_ns: int, position_xyz: Floats) -> NavSatFix:
        """The fix of an antenna there: metres east, north and up of the world's origin."""
        noise = self._white * self._random.standard_normal(3)
        east, north, up = (position_xyz + noise + self._drift.step()).tolist()
        latitude, longitude, altitude = self._origin
        to_north, to_east = self._degrees
        return NavSatFix(
            latitude + north * to_north,
            longitude + east * to_east,
            altitude + up,
            self._covariance,
            _DIAGONAL_KNOWN,
            header=Header(stamp_ns, self.frame_id),
        )


def _degrees_per_metre(latitude: float, altitude: float) -> tuple[float, float]:
    """Degrees of latitude and of longitude in a metre north and east.

    Source: Torge, Geodesy, 2001, section 4.1.3: radii of curvature in meridian and prime vertical.
    """
    phi = math.radians(latitude)
    eccentricity2 = _FLATTENING * (2 - _FLATTENING)
    bend = 1 - eccentricity2 * math.sin(phi) ** 2
    prime = _EQUATOR_M / math.sqrt(bend)
    meridian = prime * (1 - eccentricity2) / bend
    to_north = math.degrees(1 / (meridian + altitude))
    return to_north, math.degrees(1 / ((prime + altitude) * math.cos(phi)))
