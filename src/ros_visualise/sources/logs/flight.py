"""The topics that any flight log gives: position, attitude, IMU and fixes, from tables of numbers.

Topics: ``/odom`` (pose in ``map``, velocities in ``base_link``), ``/path``, ``/tf``, ``/imu/data``,
``/gps/fix``. ``map`` has its origin where the estimator was started, x east, y north, z up;
``base_link`` has x forward, y left, z up; ``gimbal`` on it too, where its angles are logged.

The tables have the names, fields, units and axes of PX4, into which other logs are brought.

Source: PX4 User Guide, uORB message reference: VehicleAttitude (w, x, y, z; FRD in NED),
VehicleLocalPosition (NED, with flags of what is valid), SensorCombined and VehicleAngularVelocity
(FRD), SensorGps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from ros_visualise.data import (
    Floats,
    Header,
    Imu,
    NavSatFix,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.data import Path as PathMessage
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import to_attitude, to_enu, to_flu
from ros_visualise.sources.logs.tables import LogTable
from ros_visualise.sources.series import Series, single

_MAP, _BASE, GIMBAL = "map", "base_link", "gimbal"
_GPS = "gps"  # the frame of the antenna
_NONE = -np.eye(3) * [[1, 0, 0]]  # covariance of what is not measured (REP 145)
_UNKNOWN = np.zeros((3, 3))
_NO_FIX, _FIX, _GBAS = -1, 0, 2
_STATUS = {0: _NO_FIX, 1: _NO_FIX, 5: _GBAS, 6: _GBAS}
"""PX4's fix_type, unless it is a plain fix -> status of sensor_msgs/NavSatFix.

RTK has a base on the ground; the origin of a differential fix's (4) corrections is unknown.
"""
_NO_COVARIANCE, _APPROXIMATED = 0, 1
_HELD_US = 100_000

_Times = npt.NDArray[np.int64]


class FlightTopics:
    """Topics made from the tables of a log.

    Args:
        utc_us: UTC minus the vehicle's clock.

    Attributes:
        series: the topics.
        notes: what was skipped, and why.
    """

    def __init__(self, tables: Mapping[str, LogTable], utc_us: int) -> None:
        self.notes: list[str] = []
        self.series: list[Series] = []
        self._utc_us = utc_us
        self._attitude = _Attitude(tables.get("vehicle_attitude"))
        self._rates = tables.get("vehicle_angular_velocity")
        position = tables.get("vehicle_local_position")
        if position is not None:
            self._add_positions(position)
        gimbal = tables.get("gimbal")
        if gimbal is not None:
            self._add_gimbal(gimbal)
        self._add_imu(tables.get("sensor_combined"))
        gps = tables.get("sensor_gps")
        if gps is not None:
            self._add_fixes(gps)

    def _stamps_ns(self, times_us: _Times) -> _Times:
        return (times_us + self._utc_us) * 1000

    def _add_positions(self, all_of_them: LogTable) -> None:
        flags = all_of_them.column("xy_valid", 1) * all_of_them.column("z_valid", 1)
        finite = np.isfinite(all_of_them.columns("x", "y", "z")).all(axis=1)
        valid = (flags != 0) & finite
        self._note(int((~valid).sum()), len(valid), "positions are not valid (xy_valid, z_valid)")
        known = valid & self._attitude.is_known(all_of_them.times_us)
        self._note(int((valid & ~known).sum()), len(valid), "positions have no attitude")
        if known.any():
            self._add_odometry(all_of_them.where(known))

    def _add_odometry(self, local: LogTable) -> None:
        stamps_ns = self._stamps_ns(local.times_us)
        positions = to_enu(local.columns("x", "y", "z"))
        quats = self._attitude.at(local.times_us)
        moving = (local.column("v_xy_valid", 1) * local.column("v_z_valid", 1)) != 0
        along = to_enu(local.columns("vx", "vy", "vz"))
        linear = (np.swapaxes(rotations.to_matrix(quats), -1, -2) @ along[..., None])[..., 0]
        linear = np.where(moving[:, None] & np.isfinite(linear), linear, 0)
        angular = self._angular(local.times_us)
        errors = local.columns("eph", "eph", "epv") ** 2

        def odometry(index: int) -> Odometry:
            covariance = np.zeros((6, 6))
            if np.isfinite(errors[index]).all():
                covariance[[0, 1, 2], [0, 1, 2]] = errors[index]
            return Odometry(
                positions[index],
                quats[index],
                linear[index],
                angular[index],
                covariance,
                child_frame_id=_BASE,
                header=Header(int(stamps_ns[index]), _MAP),
            )

        def transform(index: int) -> Transforms:
            header = Header(int(stamps_ns[index]), _MAP)
            return Transforms((TransformStamped(_BASE, positions[index], quats[index], header),))

        start_ns = int(stamps_ns.min())
        path = PathMessage(stamps_ns, positions, quats, Header(start_ns, _MAP))
        self.series += [
            Series("/odom", Odometry, stamps_ns, odometry),
            Series("/tf", Transforms, stamps_ns, transform),
            single("/path", path, start_ns),
        ]

    def _add_gimbal(self, gimbal: LogTable) -> None:
        """Its angles against the horizon, and against the heading or north, on the body."""
        angles = gimbal.columns("roll", "pitch", "yaw")
        gimbal = gimbal.where(
            np.isfinite(angles).all(axis=1) & self._attitude.is_known(gimbal.times_us)
        )
        if not len(gimbal.times_us):
            return
        own = self._attitude.at(gimbal.times_us)
        roll, pitch, yaw = gimbal.columns("roll", "pitch", "yaw").T
        headings = np.where(
            gimbal.column("is_on_body", 1) != 0, rotations.to_rpy(own)[:, 2], math.pi / 2
        )
        turns = rotations.from_rpy(np.stack([roll, -pitch, headings - yaw], axis=1))
        quats = rotations.multiply(rotations.inverse(own), turns)
        stamps_ns = self._stamps_ns(gimbal.times_us)

        def transform(index: int) -> Transforms:
            header = Header(int(stamps_ns[index]), _BASE)
            return Transforms((TransformStamped(GIMBAL, np.zeros(3), quats[index], header),))

        self._add_transforms(stamps_ns, transform)

    def _add_transforms(self, stamps_ns: _Times, make: Callable[[int], Transforms]) -> None:
        """Let ``/tf`` have these too."""
        former = next((one for one in self.series if one.topic == "/tf"), None)
        if former is None:
            self.series.append(Series("/tf", Transforms, stamps_ns, make))
            return
        both = np.concatenate((former.stamps_ns, stamps_ns))
        order, count, first = np.argsort(both, kind="stable"), len(former.stamps_ns), former.make

        def either(index: int) -> Transforms:
            place = int(order[index])
            return first(place) if place < count else make(place - count)

        place = self.series.index(former)
        self.series[place] = Series("/tf", Transforms, both[order], either)

    def _add_imu(self, sensors: LogTable | None) -> None:
        """At the stamps of accelerometer and gyroscope, else of the attitude."""
        times_us = self._attitude.times_us if sensors is None else sensors.times_us
        if not len(times_us):
            return
        known, quats = self._attitude.is_known(times_us), self._attitude.at(times_us)
        accelerations = np.zeros((len(times_us), 3))
        angular = self._angular(times_us)
        if sensors is not None:
            accelerations = to_flu(sensors.vector("accelerometer_m_s2", 3))
            angular = to_flu(sensors.vector("gyro_rad", 3))
        stamps_ns = self._stamps_ns(times_us)
        has_rates = sensors is not None or self._rates is not None

        def imu(index: int) -> Imu:
            return Imu(
                quats[index],
                angular[index],
                accelerations[index],
                orientation_covariance=_UNKNOWN if known[index] else _NONE,
                angular_covariance=_UNKNOWN if has_rates else _NONE,
                linear_covariance=_UNKNOWN if sensors is not None else _NONE,
                header=Header(int(stamps_ns[index]), _BASE),
            )

        self.series.append(Series("/imu/data", Imu, stamps_ns, imu))

    def _add_fixes(self, gps: LogTable) -> None:
        stamps_ns = self._stamps_ns(gps.times_us)
        places = _places(gps)
        types = gps.column("fix_type").astype(int)
        errors = gps.columns("eph", "eph", "epv") ** 2
        known = np.logical_and(np.isfinite(errors).all(axis=1), gps.has("eph", "epv"))

        def fix(index: int) -> NavSatFix:
            latitude, longitude, altitude = places[index].tolist()
            return NavSatFix(
                latitude,
                longitude,
                altitude,
                covariance=np.diag(errors[index]) if known[index] else _UNKNOWN,
                covariance_type=_APPROXIMATED if known[index] else _NO_COVARIANCE,
                status=_STATUS.get(int(types[index]), _FIX),
                header=Header(int(stamps_ns[index]), _GPS),
            )

        self.series.append(Series("/gps/fix", NavSatFix, stamps_ns, fix))

    def _angular(self, times_us: _Times) -> Floats:
        if self._rates is None:
            return np.zeros((len(times_us), 3))
        rates = to_flu(self._rates.vector("xyz", 3))
        columns = [np.interp(times_us, self._rates.times_us, column) for column in rates.T]
        return np.stack(columns, axis=1)

    def _note(self, count: int, of: int, what: str) -> None:
        if count:
            self.notes.append(f"{count} of {of} {what}; skipped")


def _places(gps: LogTable) -> Floats:
    """Latitude, longitude and altitude above the ellipsoid (N, 3), in the units of any version.

    A log without the altitude above the ellipsoid gives the one above the sea.
    """
    if gps.has("latitude_deg"):
        high = "altitude_ellipsoid_m" if gps.has("altitude_ellipsoid_m") else "altitude_msl_m"
        return gps.columns("latitude_deg", "longitude_deg", high)
    high = "alt_ellipsoid" if gps.has("alt_ellipsoid") else "alt"
    return gps.columns("lat", "lon", high) * [1e-7, 1e-7, 1e-3]


class _Attitude:
    """Attitude at any time; it is held for a moment before the first and after the last sample."""

    def __init__(self, table: LogTable | None) -> None:
        none = np.zeros(0, np.int64)
        self.times_us = none if table is None else table.times_us
        if table is not None:
            quats = table.vector("q", 4)
            norms = np.linalg.norm(quats, axis=1)
            whole = (norms > 0.5) & (norms < 1.5)
            self.times_us = self.times_us[whole]
            self._quats = to_attitude(quats[whole])

    def is_known(self, times_us: _Times) -> npt.NDArray[np.bool_]:
        """(N,) true for times at which it is known."""
        if not len(self.times_us):
            return np.zeros(len(times_us), bool)
        first, last = self.times_us[[0, -1]]
        known: npt.NDArray[np.bool_] = times_us >= first - _HELD_US
        known &= times_us <= last + _HELD_US
        return known

    def at(self, times_us: _Times) -> Floats:
        """(N, 4) x, y, z, w; where it is unknown, that of the map."""
        if not len(self.times_us):
            return np.tile([0.0, 0.0, 0.0, 1.0], (len(times_us), 1))
        places = np.interp(times_us, self.times_us, np.arange(len(self.times_us)))
        before = places.astype(int)
        after = np.minimum(before + 1, len(self.times_us) - 1)
        return rotations.slerp(self._quats[before], self._quats[after], places - before)
