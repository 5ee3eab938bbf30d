"""Messages of a vehicle, as ours: in the axes, units and frames of ROS.

``odom`` is the vehicle's local frame, x east, y north, z up; ``base_link`` its body, x forward, y
left, z up.

Source: mavlink.io, common messages.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import (
    Floats,
    Header,
    Imu,
    NavSatFix,
    Number,
    Odometry,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.aircraft import to_attitude, to_enu, to_flu
from ros_visualise.geometry.frames import FrameTree, WrongTransforms
from ros_visualise.geometry.geodesy import LocalPlane

ODOM, BODY, GIMBAL, GPS = "odom", "base_link", "gimbal", "gps"
OUTPUTS: dict[str, type[Any]] = {
    "odom": Odometry,
    "tf": Transforms,
    "attitude": Imu,
    "imu": Imu,
    "fix": NavSatFix,
    "global_position": NavSatFix,
    "battery": Number,
    "text": Text,
}
"""Topics of a vehicle -> their messages."""

FROM_ANY = ("STATUSTEXT", "GIMBAL_DEVICE_ATTITUDE_STATUS", "MOUNT_ORIENTATION")
"""Messages that other components of a vehicle send for it too, such as its gimbal."""

Answer = tuple[str, Any]
_G = 9.80665e-3
_UNKNOWN = np.zeros((3, 3))
_NONE = np.diag((-1.0, 0.0, 0.0))  # not measured (REP 145)
_NO_FIX, _FIX, _GBAS = -1, 0, 2
_STATUS = {0: _NO_FIX, 1: _NO_FIX, 5: _GBAS, 6: _GBAS}
_APPROXIMATED = 1
_UPPER = np.triu_indices(6)
_SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SIX_ENU = np.kron(np.eye(2), _SWAP)
"""(6, 6): north, east, down and rotations about them -> east, north, up; and back."""
_YAW_IN_VEHICLE = 32  # of GIMBAL_DEVICE_FLAGS
_PREFERRED_NS = 1_000_000_000
_KEPT_S, _NEAR_S = 5.0, 0.3  # of poses
_FARTHEST_M, _HIGHEST_M = 1e7, 1e6
_LARGEST = 1e4  # of angles, rates and accelerations
_NO_ACCURACY = 0xFFFFFFFF


class Telemetry:
    """Makes our messages of those of one vehicle.

    Attributes:
        quat_xyzw: attitude of the body in ``odom``; None: unknown yet.
        position_xyz: position in ``odom``; None: unknown yet.
        geodetic: latitude, longitude, and height above the sea; None: unknown yet.
    """

    def __init__(self) -> None:
        self.quat_xyzw: Floats | None = None
        self.position_xyz: Floats | None = None
        self.geodetic: Floats | None = None
        self._rates: Floats = np.zeros(3)
        self._frames = FrameTree(_KEPT_S)
        self._odometry_ns = -_PREFERRED_NS  # when ODOMETRY came, which has covariances

    def pose_at(self, stamp_ns: int | None) -> tuple[Floats, Floats] | None:
        """Position and R_odom_body at a time, or at the nearest one, None: now; None if unknown."""
        if self.position_xyz is None or self.quat_xyzw is None:
            return None
        if stamp_ns is not None:
            with suppress(NoTransform):
                T = self._frames.lookup(ODOM, BODY, stamp_ns, _NEAR_S)
                return T[:3, 3], T[:3, :3]
        return self.position_xyz, rotations.to_matrix(self.quat_xyzw)

    def on_earth(self, place_xyz: Floats) -> Floats | None:
        """Latitude, longitude and height above the sea of a place in ``odom``; None if unknown."""
        if self.geodetic is None or self.position_xyz is None:
            return None
        plane = LocalPlane(*self.geodetic.tolist())
        return plane.from_enu(place_xyz - self.position_xyz)

    def take(self, message: Any, stamp_ns: int) -> Iterator[Answer]:
        """Output and message of ours, for a message of pymavlink."""
        make = _MAKERS.get(message.get_type())
        if make is not None:
            yield from make(self, message, stamp_ns)

    def attitude(self, m: Any, stamp_ns: int) -> Iterable[Answer]:
        """ATTITUDE."""
        if not _is_sane([m.roll, m.pitch, m.yaw]):
            return ()
        x, y, z, w = rotations.from_rpy([m.roll, m.pitch, m.yaw])
        return self._turn(np.array([w, x, y, z]), m, stamp_ns)

    def quaternion(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """ATTITUDE_QUATERNION."""
        return self._turn(np.array([m.q1, m.q2, m.q3, m.q4]), m, stamp_ns)

    def _turn(self, quat_wxyz: Floats, m: Any, stamp_ns: int) -> Iterator[Answer]:
        rates = [m.rollspeed, m.pitchspeed, m.yawspeed]
        if not (0.5 < np.linalg.norm(quat_wxyz) < 1.5 and _is_sane(rates)):  # NaN too
            return
        self.quat_xyzw = to_attitude(quat_wxyz)
        self._rates = to_flu(rates)
        yield (
            "attitude",
            Imu(
                self.quat_xyzw,
                self._rates,
                np.zeros(3),
                linear_covariance=_NONE,
                header=Header(stamp_ns, BODY),
            ),
        )

    def local(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """LOCAL_POSITION_NED."""
        at, along = to_enu([m.x, m.y, m.z]), to_enu([m.vx, m.vy, m.vz])
        is_second = stamp_ns - self._odometry_ns < _PREFERRED_NS
        if self.quat_xyzw is None or is_second or not _is_sane([*at, *along], _FARTHEST_M):
            return
        linear = rotations.to_matrix(self.quat_xyzw).T @ along
        yield from self._placed(at, self.quat_xyzw, linear, self._rates, np.zeros((6, 6)), stamp_ns)

    def odometry(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """ODOMETRY in the local frame, with its covariance."""
        at, quat = to_enu([m.x, m.y, m.z]), np.asarray(m.q, np.float64)
        norm = np.linalg.norm(quat)
        linear, angular = (
            np.nan_to_num(to_flu(one))
            for one in ([m.vx, m.vy, m.vz], [m.rollspeed, m.pitchspeed, m.yawspeed])
        )
        is_placed = m.frame_id == 1 and _is_sane(at, _FARTHEST_M) and 0.5 < norm < 1.5
        if not (is_placed and _is_sane([*linear, *angular])):
            return
        self._odometry_ns, self.quat_xyzw = stamp_ns, to_attitude(quat)
        covariance = _covariance(m.pose_covariance)
        yield from self._placed(at, self.quat_xyzw, linear, angular, covariance, stamp_ns)

    def _placed(
        self,
        at: Floats,
        quat: Floats,
        linear: Floats,
        angular: Floats,
        covariance: Floats,
        stamp_ns: int,
    ) -> Iterator[Answer]:
        self.position_xyz = at
        header = Header(stamp_ns, ODOM)
        yield (
            "odom",
            Odometry(at, quat, linear, angular, covariance, child_frame_id=BODY, header=header),
        )
        transform = TransformStamped(BODY, at, quat, header)
        with suppress(WrongTransforms):  # its clock jumped
            self._frames.add(transform)
        yield "tf", Transforms((transform,))

    def imu(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """HIGHRES_IMU in SI units; SCALED_IMU and ArduPilot's RAW_IMU in thousandths."""
        force, rate = (1.0, 1.0) if m.get_type() == "HIGHRES_IMU" else (_G, 1e-3)
        quat = self.quat_xyzw
        angular = rate * to_flu([m.xgyro, m.ygyro, m.zgyro])
        linear = force * to_flu([m.xacc, m.yacc, m.zacc])
        if not _is_sane([*angular, *linear]):
            return
        yield (
            "imu",
            Imu(
                np.array([0.0, 0.0, 0.0, 1.0]) if quat is None else quat,
                angular,
                linear,
                orientation_covariance=_NONE if quat is None else _UNKNOWN,
                header=Header(stamp_ns, BODY),
            ),
        )

    def gps(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """GPS_RAW_INT; heights above the ellipsoid where they come, else above the sea."""
        high = m.alt_ellipsoid or m.alt
        accuracy = np.array([m.h_acc, m.h_acc, m.v_acc]) * 1e-3
        is_known = min(m.h_acc, m.v_acc) > 0 and max(m.h_acc, m.v_acc) < _NO_ACCURACY
        where = (m.lat * 1e-7, m.lon * 1e-7, high * 1e-3)
        if not _is_on_earth(where):
            return
        fix = NavSatFix(
            *where,
            covariance=np.diag(accuracy**2) if is_known else _UNKNOWN,
            covariance_type=_APPROXIMATED if is_known else 0,
            status=_STATUS.get(m.fix_type, _FIX),
            header=Header(stamp_ns, GPS),
        )
        yield "fix", fix

    def fused(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """GLOBAL_POSITION_INT: the vehicle's own estimate, its height above the sea."""
        where = (m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3)
        if not _is_on_earth(where):
            return
        self.geodetic = np.array(where)
        yield "global_position", NavSatFix(*where, header=Header(stamp_ns, BODY))

    def battery(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """SYS_STATUS: volts."""
        if m.voltage_battery != 0xFFFF:
            yield "battery", Number(m.voltage_battery * 1e-3, Header(stamp_ns))

    def text(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """STATUSTEXT."""
        yield "text", Text(m.text, Header(stamp_ns))

    def gimbal(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """GIMBAL_DEVICE_ATTITUDE_STATUS: against the horizon, and north or the vehicle."""
        quat = np.asarray(m.q, np.float64)
        if self.quat_xyzw is None or not 0.5 < np.linalg.norm(quat) < 1.5:
            return
        turn = to_attitude(quat)
        if m.flags & _YAW_IN_VEHICLE:
            yaw = rotations.to_rpy(self.quat_xyzw)[2] - math.pi / 2  # of ENU, from north
            turn = rotations.multiply(rotations.from_rpy([0, 0, yaw]), turn)
        yield self._aimed(turn, stamp_ns)

    def mount(self, m: Any, stamp_ns: int) -> Iterator[Answer]:
        """MOUNT_ORIENTATION: the yaw is the vehicle's; the deprecated form of the above."""
        if self.quat_xyzw is None or not np.isfinite([m.roll, m.pitch, m.yaw]).all():
            return
        roll, pitch, yaw = np.radians([m.roll, -m.pitch, -m.yaw])
        heading = rotations.to_rpy(self.quat_xyzw)[2]
        yield self._aimed(rotations.from_rpy([roll, pitch, heading + yaw]), stamp_ns)

    def _aimed(self, quat_xyzw: Floats, stamp_ns: int) -> Answer:
        """The gimbal on the body; its place there is unknown."""
        assert self.quat_xyzw is not None
        on_body = rotations.multiply(rotations.inverse(self.quat_xyzw), quat_xyzw)
        one = TransformStamped(GIMBAL, np.zeros(3), on_body, Header(stamp_ns, BODY))
        return "tf", Transforms((one,))


_MAKERS: dict[str, Callable[[Telemetry, Any, int], Iterable[Answer]]] = {
    "ATTITUDE": Telemetry.attitude,
    "ATTITUDE_QUATERNION": Telemetry.quaternion,
    "LOCAL_POSITION_NED": Telemetry.local,
    "ODOMETRY": Telemetry.odometry,
    "HIGHRES_IMU": Telemetry.imu,
    "SCALED_IMU": Telemetry.imu,
    "RAW_IMU": Telemetry.imu,
    "GPS_RAW_INT": Telemetry.gps,
    "GLOBAL_POSITION_INT": Telemetry.fused,
    "SYS_STATUS": Telemetry.battery,
    "STATUSTEXT": Telemetry.text,
    "GIMBAL_DEVICE_ATTITUDE_STATUS": Telemetry.gimbal,
    "MOUNT_ORIENTATION": Telemetry.mount,
}


def _is_sane(values: Sequence[float] | Floats, largest: float = _LARGEST) -> bool:
    """False for NaN and what no vehicle measures."""
    return bool((np.abs(values) < largest).all())


def _is_on_earth(where: Sequence[float]) -> bool:
    latitude, longitude, height = map(abs, where)
    return latitude <= 90 and longitude <= 180 and height < _HIGHEST_M


def _covariance(upper: Any) -> Floats:
    """(6, 6) of the 21 numbers of its upper triangle; 0 where they are unknown."""
    values = np.asarray(upper, np.float64)
    whole = np.zeros((6, 6))
    if np.isfinite(values).all():
        whole[_UPPER] = values
        whole = whole + np.triu(whole, 1).T
    turned: Floats = SIX_ENU @ whole @ SIX_ENU.T
    return turned
