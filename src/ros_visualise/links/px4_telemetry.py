"""The telemetry of a simulated vehicle: its own estimate, in the axes and messages of aircraft."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Imu, NavSatFix, Odometry
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import to_attitude, to_enu, to_flu
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.links.mavlink import dialect
from ros_visualise.links.telemetry import SIX_ENU

_LOCAL_NED, _BODY_FRD = 1, 12
_UPPER = np.triu_indices(6)
_VOLTS, _CELLS = 16.2, 4
_AUTOPILOT = 8  # MAV_ESTIMATOR_TYPE
_BEGIN_NS = 1_000_000_000  # a time of 0 is an unknown one to many


class OwnTelemetry:
    """The state of a vehicle by its odometry, and the last measurements of its sensors.

    Its local frame is that of the odometry, with its drift, turned to the north. Positions on the
    Earth are relative to the first fix of the GPS receiver.

    Attributes:
        home: where it was armed: north, east, down.
        is_known: true once there was odometry; then the following hold.
        odometry: the last one.
        time_s: since its start.
        position, velocity: north, east, down.
        quat_wxyz, rpy: attitude of forward, right, down in north, east, down.
        rates: about forward, right, down.
        resets: number of jumps of its position.
        variances: of north, east, down and heading, if another estimate gives them.
    """

    odometry: Odometry
    time_s: float
    position: Floats
    velocity: Floats
    quat_wxyz: Floats
    rpy: list[float]
    rates: list[float]

    def __init__(self) -> None:
        self.home: Floats = np.zeros(3)
        self.is_known = False
        self.resets = 0
        self.variances: Floats | None = None
        self._turn: Floats = np.eye(3)  # R_enu_odom
        self._imu: Imu | None = None
        self._fix: NavSatFix | None = None
        self._plane: LocalPlane | None = None  # of the local frame
        self._begin_ns = 0
        self._dialect = dialect()

    def sense(self, message: Imu | NavSatFix) -> None:
        """Take a measurement of a sensor."""
        if isinstance(message, Imu):
            self._imu = message
        elif np.isfinite([message.latitude, message.longitude, message.altitude]).all():
            self._fix = message

    def measure(self, odometry: Odometry, yaw: float) -> None:
        """Take the odometry, in a frame with z up, whose x axis heads ``yaw`` north of east."""
        stamp_ns = odometry.header.stamp_ns
        if not self.is_known or stamp_ns < self._begin_ns:
            self._begin_ns = stamp_ns - _BEGIN_NS
        self.odometry, self.is_known = odometry, True
        self.time_s = (stamp_ns - self._begin_ns) / 1e9
        turn = rotations.from_rpy([0, 0, yaw])
        self._turn = rotations.to_matrix(turn)
        quat = rotations.multiply(turn, odometry.quat_xyzw)
        self.position = to_enu(self._turn @ odometry.position_xyz)
        self.velocity = to_enu(rotations.to_matrix(quat) @ odometry.linear_xyz)
        quat_xyzw = to_attitude(np.roll(quat, 1))  # which turns back too
        self.quat_wxyz, self.rpy = np.roll(quat_xyzw, 1), rotations.to_rpy(quat_xyzw).tolist()
        self.rates = to_flu(odometry.angular_xyz).tolist()
        if self._plane is None and self._fix is not None:
            fix = [self._fix.latitude, self._fix.longitude, self._fix.altitude]
            origin = LocalPlane(*fix).from_enu(-self._turn @ odometry.position_xyz)
            self._plane = LocalPlane(*origin.tolist())

    def correct(self, yaw: float, turned: Callable[[Floats], Floats], shift: Floats) -> None:
        """Turn its state by a heading, and shift it."""
        self.position = turned(self.position) + shift
        self.velocity = turned(self.velocity)
        quat = rotations.multiply(rotations.from_rpy([0, 0, yaw]), np.roll(self.quat_wxyz, -1))
        self.quat_wxyz, self.rpy = np.roll(quat, 1), rotations.to_rpy(quat).tolist()

    def forget_earth(self) -> None:
        """Know no positions on the Earth."""
        self._plane = None

    def message(self, name: str) -> Any:
        """The message of that name; None if it is unknown, or not measured yet."""
        make = _MAKERS.get(name)
        return make(self) if make is not None and self.is_known else None

    def place(self, ned: Floats) -> list[int]:
        """Latitude, longitude (1e-7 degrees) and altitude (mm) of a place; 0 if unknown."""
        if self._plane is None:
            return [0, 0, 0]
        latitude, longitude, altitude = self._plane.from_enu(to_enu(ned)).tolist()
        return [round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)]

    def ned(self, latitude: float, longitude: float, altitude: float) -> Floats | None:
        """The place north, east, down of degrees and metres above the sea; None if unknown."""
        if self._plane is None or not (abs(latitude) <= 90 and abs(longitude) <= 180):
            return None
        level = 0.0 if math.isnan(altitude) else altitude
        found = to_enu(self._plane.to_enu([latitude, longitude, level]))
        if math.isnan(altitude):
            found[2] = math.nan
        return found

    def _attitude(self) -> Any:
        ms = round(self.time_s * 1e3)
        return self._dialect.MAVLink_attitude_message(ms, *self.rpy, *self.rates)

    def _quaternion(self) -> Any:
        ms, quat = round(self.time_s * 1e3), self.quat_wxyz.tolist()
        return self._dialect.MAVLink_attitude_quaternion_message(ms, *quat, *self.rates)

    def _local(self) -> Any:
        both = *self.position.tolist(), *self.velocity.tolist()
        return self._dialect.MAVLink_local_position_ned_message(round(self.time_s * 1e3), *both)

    def _odometry_message(self) -> Any:
        turned = np.kron(np.eye(2), self._turn) @ self.odometry.pose_covariance
        turned = SIX_ENU @ turned @ np.kron(np.eye(2), self._turn.T) @ SIX_ENU.T
        if self.variances is not None:
            turned[[0, 1, 2, 5], [0, 1, 2, 5]] = self.variances
        twist = np.kron(np.eye(2), np.diag((1.0, -1.0, -1.0)))
        speeds = twist @ self.odometry.twist_covariance @ twist.T
        return self._dialect.MAVLink_odometry_message(
            round(self.time_s * 1e6),
            _LOCAL_NED,
            _BODY_FRD,
            *self.position.tolist(),
            self.quat_wxyz.tolist(),
            *to_flu(self.odometry.linear_xyz).tolist(),
            *self.rates,
            turned[_UPPER].tolist(),
            speeds[_UPPER].tolist(),
            self.resets % 256,
            _AUTOPILOT,
        )

    def _global(self) -> Any:
        if self._plane is None:
            return None
        latitude, longitude, altitude = self.place(self.position)
        above = round(1e3 * float(self.home[2] - self.position[2]))
        speeds = np.clip(np.round(100 * self.velocity), -32768, 32767).astype(int).tolist()
        heading = round(100 * math.degrees(self.rpy[2])) % 36000
        return self._dialect.MAVLink_global_position_int_message(
            round(self.time_s * 1e3), latitude, longitude, altitude, above, *speeds, heading
        )

    def _gps(self) -> Any:
        if self._fix is None:
            return None
        fix, sigma = self._fix, np.sqrt(np.diag(self._fix.covariance)) * 1e3
        place = round(fix.latitude * 1e7), round(fix.longitude * 1e7), round(fix.altitude * 1e3)
        return self._dialect.MAVLink_gps_raw_int_message(
            round(self.time_s * 1e6),
            3 if fix.status >= 0 else 1,
            *place,
            80,
            120,
            min(round(100 * float(np.hypot(*self.velocity[:2]))), 65534),
            65535,
            14,
            alt_ellipsoid=place[2],
            h_acc=round(float(sigma[0])),
            v_acc=round(float(sigma[2])),
        )

    def _highres(self) -> Any:
        if self._imu is None:
            return None
        force, rate = to_flu(self._imu.linear_xyz).tolist(), to_flu(self._imu.angular_xyz).tolist()
        return self._dialect.MAVLink_highres_imu_message(
            round(self.time_s * 1e6), *force, *rate, *[0.0] * 7, 0x3F
        )

    def _hud(self) -> Any:
        speed, heading = float(np.hypot(*self.velocity[:2])), math.degrees(self.rpy[2]) % 360
        altitude = self.place(self.position)[2] / 1e3
        return self._dialect.MAVLink_vfr_hud_message(
            speed, speed, int(heading), 0, altitude, -float(self.velocity[2])
        )

    def _battery(self) -> Any:
        cells = [round(_VOLTS / _CELLS * 1e3)] * _CELLS + [0xFFFF] * (10 - _CELLS)
        return self._dialect.MAVLink_battery_status_message(0, 1, 1, 32767, cells, -1, -1, -1, 100)

    def _home(self) -> Any:
        if self._plane is None:
            return None
        return self._dialect.MAVLink_home_position_message(
            *self.place(self.home),
            *self.home.tolist(),
            [1.0, 0.0, 0.0, 0.0],
            *[math.nan] * 3,
        )


_MAKERS = {
    "ATTITUDE": OwnTelemetry._attitude,
    "ATTITUDE_QUATERNION": OwnTelemetry._quaternion,
    "LOCAL_POSITION_NED": OwnTelemetry._local,
    "ODOMETRY": OwnTelemetry._odometry_message,
    "GLOBAL_POSITION_INT": OwnTelemetry._global,
    "GPS_RAW_INT": OwnTelemetry._gps,
    "HIGHRES_IMU": OwnTelemetry._highres,
    "VFR_HUD": OwnTelemetry._hud,
    "BATTERY_STATUS": OwnTelemetry._battery,
    "HOME_POSITION": OwnTelemetry._home,
}
