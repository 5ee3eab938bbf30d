"""A GPS receiver."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import GaussMarkov, random_of
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

_DIAGONAL_KNOWN = 2  # COVARIANCE_TYPE_DIAGONAL_KNOWN

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
        0.8, "slow error east and north (standard deviation), m", min=0, max=100
    )
    gps_drift_time: float = _gps(60.0, "time constant of the slow error, seconds", min=0.1, max=1e5)
    gps_vertical: float = _gps(2.0, "factor of the errors in height", min=0, max=10)
    gps_latitude: float = _gps(49.0, "latitude of the world's origin, degrees", min=-89, max=89)
    gps_longitude: float = _gps(8.4, "longitude of the world's origin, degrees", min=-180, max=180)
    gps_altitude: float = _gps(116.0, "altitude of the world's origin, m", min=-500, max=9000)


class GpsSensor:
    """Positions with a slow error, as from satellites and atmosphere, and white noise."""

    frame_id = "gps_link"

    def __init__(self, params: GpsParams, seed: int) -> None:
        self._random = random_of(seed, "gps")
        axes = np.array([1.0, 1.0, params.gps_vertical])
        self._white = params.gps_noise * axes
        drift = params.gps_drift * axes
        self._drift = GaussMarkov(self._random, drift, params.gps_drift_time)
        self._covariance = np.diag(self._white**2 + drift**2)
        origin = params.gps_latitude, params.gps_longitude, params.gps_altitude
        self._plane = LocalPlane(*origin)

    def measure(self, stamp_ns: int, position_xyz: Floats) -> NavSatFix:
        """The fix of an antenna: metres east, north and up of the world's origin."""
        noise = self._white * self._random.standard_normal(3)
        drift = self._drift.at(stamp_ns)
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


def fit(fitting: Fitting) -> Measure:
    """The receiver, at its antenna."""
    body, gps = fitting.robot.body, GpsSensor(fitting.settings, fitting.seed)
    return lambda stamp_ns, _: {"fix": gps.measure(stamp_ns, body.site("gps_link")[0])}


SENSOR = SensorType(
    GpsParams, {"fix": NavSatFix}, "gps_rate", fit, "gps", always=True, delivery="gps"
)
