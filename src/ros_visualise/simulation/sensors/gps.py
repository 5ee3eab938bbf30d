"""A GPS receiver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import Episodes, GaussMarkov, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_DIAGONAL_KNOWN = 2  # COVARIANCE_TYPE_DIAGONAL_KNOWN
_NO_FIX = -1  # STATUS_NO_FIX

_gps = partial(setting, group="gps")


@delivered("gps", "gps")
@dataclass(frozen=True)
class GpsParams:
    """Parameters of a GPS receiver."""

    gps: bool = _gps(True, "switch the GPS receiver on")
    gps_rate: float = _gps(5.0, "fixes per second", min=0.1, max=50)
    gps_noise: float = _gps(
        0.15, "white noise east and north (standard deviation), m", min=0, max=100
    )
    gps_drift: float = _gps(
        0.8, "slowly varying error east and north (standard deviation), m", min=0, max=100
    )
    gps_drift_time: float = _gps(
        60.0, "time constant of the varying error, seconds", min=0.1, max=1e5
    )
    gps_vertical: float = _gps(
        2.0, "errors in height, as a multiple of the horizontal errors", min=0, max=10
    )
    gps_latitude: float = _gps(49.0, "latitude of the world's origin, degrees", min=-89, max=89)
    gps_longitude: float = _gps(8.4, "longitude of the world's origin, degrees", min=-180, max=180)
    gps_altitude: float = _gps(116.0, "altitude of the world's origin, m", min=-500, max=9000)
    gps_outage_every: float = _gps(
        0.0, "mean time between outages, seconds; 0: none", min=0, max=1e5
    )
    gps_outage_for: float = _gps(10.0, "mean duration of an outage, seconds", min=0.1, max=1e4)
    gps_jump: float = _gps(
        3.0, "error during multipath, east and north (standard deviation), m", min=0, max=1000
    )
    gps_jump_every: float = _gps(
        0.0, "mean time between multipath errors, seconds; 0: none", min=0, max=1e5
    )
    gps_jump_for: float = _gps(5.0, "mean duration of multipath, seconds", min=0.1, max=1e4)


class GpsSensor:
    """Positions with a slow error, as from satellites and atmosphere, and white noise.

    In an outage there is no fix. The covariance knows nothing of multipath, which puts the fixes
    aside for a while.
    """

    frame_id = "gps_link"

    def __init__(self, params: GpsParams, seed: int) -> None:
        self._random = random_of(seed, "gps")
        axes = np.array([1.0, 1.0, params.gps_vertical])
        self._white = params.gps_noise * axes
        drift = params.gps_drift * axes
        self._drift = GaussMarkov(self._random, drift, params.gps_drift_time)
        self._covariance = np.diag(self._white**2 + drift**2)
        self._outages = Episodes(
            random_of(seed, "gps_outages"), params.gps_outage_every, params.gps_outage_for
        )
        self._jump_random = random_of(seed, "gps_jumps")
        self._jumps = Episodes(self._jump_random, params.gps_jump_every, params.gps_jump_for)
        self._jump = params.gps_jump * axes
        self._jumped, self._aside = 0, np.zeros(3)
        origin = params.gps_latitude, params.gps_longitude, params.gps_altitude
        self._plane = LocalPlane(*origin)

    def measure(self, stamp_ns: int, position_xyz: Floats) -> NavSatFix:
        """The fix of an antenna: metres east, north and up of the world's origin."""
        noise = self._white * self._random.standard_normal(3)
        drift = self._drift.at(stamp_ns)
        if self._outages.active(stamp_ns):
            return _no_fix(Header(stamp_ns, self.frame_id))
        place = position_xyz + noise + drift + self._multipath(stamp_ns)
        latitude, longitude, altitude = self._plane.from_enu(place).tolist()
        return NavSatFix(
            latitude,
            longitude,
            altitude,
            self._covariance,
            _DIAGONAL_KNOWN,
            header=Header(stamp_ns, self.frame_id),
        )

    def _multipath(self, stamp_ns: int) -> Floats:
        """The present error by multipath (3,), metres."""
        if not self._jumps.active(stamp_ns):
            return np.zeros(3)
        if self._jumped != self._jumps.number:
            self._jumped = self._jumps.number
            self._aside = self._jump * self._jump_random.standard_normal(3)
        return self._aside


def _no_fix(header: Header) -> NavSatFix:
    nowhere = math.nan
    return NavSatFix(nowhere, nowhere, nowhere, status=_NO_FIX, header=header)


def fit(fitting: Fitting) -> Measure:
    """The receiver, at its antenna."""
    body, gps = fitting.robot.body, GpsSensor(fitting.settings, fitting.seed)
    return lambda stamp_ns, _: {"fix": gps.measure(stamp_ns, body.site("gps_link")[0])}


SENSOR = SensorType(
    GpsParams, {"fix": NavSatFix}, "gps_rate", fit, "gps", always=True, delivery="gps"
)
