"""The OXTS RT3003 of KITTI: GPS position, attitude, angular velocity and acceleration.

``odom`` is KITTI's own Mercator map with the axes east, north and up; its origin is where base_link
was at the first sample. base_link is the point on the road below the IMU, with the IMU's axes.

Source: A. Geiger et al., Vision meets Robotics: The KITTI Dataset, IJRR 2013, and the development
kit's dataformat.txt; the height of the IMU over the road, 0.93 m, is on KITTI's page of the setup.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_numbers
from ros_visualise.data import Floats, Header, Imu, NavSatFix, Odometry, TwistStamped
from ros_visualise.geometry import geodesy, rotations, se3
from ros_visualise.sources.kitti.files import FrameFiles
from ros_visualise.sources.kitti.sensors import BASE, IMU, ODOM, moving_series
from ros_visualise.sources.series import DamagedFile, Series

T_BASE_IMU = se3.from_parts(np.eye(3), [0, 0, 0.93])

_COLUMNS = (
    "lat lon alt roll pitch yaw vn ve vf vl vu ax ay az af al au wx wy wz wf wl wu"
    " pos_accuracy vel_accuracy navstat numsats posmode velmode orimode"
)
_AT = {name: column for column, name in enumerate(_COLUMNS.split())}
_VERTICAL = 2.0  # heights of satellite navigation are about half as good
_NO_FIX, _FIX, _SBAS_FIX, _GBAS_FIX = -1, 0, 1, 2
_APPROXIMATED = 1
_LOCKING = 3  # a navstat from which on the position is navigated
_STATUS = {
    **dict.fromkeys((0, 1, 2, 10, 11), _NO_FIX),  # none, searching, doppler, no data, blanked
    **dict.fromkeys((5, 6), _GBAS_FIX),  # RTK float and integer, from a base on the ground
    **dict.fromkeys((7, 8, 9), _SBAS_FIX),  # WAAS and OmniSTAR, from satellites
}
"""posmode as the development kit's gps_mode_to_string names it -> sensor_msgs/NavSatStatus.

The others are plain fixes, also a differential one (4): whose corrections it has is not known.
"""


def read_samples(files: FrameFiles) -> tuple[list[int], Floats, list[DamagedFile]]:
    """Indices of the intact files, their numbers (N, 30), and the damage of the others."""
    rows, whole, damaged = [], [], []
    for index in range(len(files)):
        try:
            rows.append(_parse(files.path(index), files.read(index)))
            whole.append(index)
        except DamagedFile as error:
            damaged.append(error)
    return whole, np.array(rows).reshape(-1, len(_AT)), damaged


def _parse(path: Path, data: bytes) -> Floats:
    try:
        check_numbers(len(data))
        numbers = np.array(data.split(), np.float64)
    except TooLarge as error:
        raise DamagedFile(path, str(error)) from None
    except ValueError:
        raise DamagedFile(path, "contains text that is not a number") from None
    if len(numbers) != len(_AT):
        raise DamagedFile(path, f"{len(numbers)} of {len(_AT)} numbers")
    if not np.isfinite(numbers).all() or abs(numbers[_AT["lat"]]) >= 90:
        raise DamagedFile(path, "a value is not a number, or not a position on the Earth")
    return numbers


class OxtsSamples:
    """Measurements of the OXTS: rows (N, 30), at least one, as in its files; stamps (N,)."""

    def __init__(self, rows: Floats, stamps_ns: npt.NDArray[np.int64]) -> None:
        self._rows, self._stamps_ns = rows, stamps_ns
        self._quats = rotations.from_rpy(self._get("roll", "pitch", "yaw"))
        self._R = rotations.to_matrix(self._quats)
        self._enu_mps = self._get("ve", "vn", "vu")
        self._rates = self._get("wx", "wy", "wz")
        self._horizontal_m = self._get("pos_accuracy")[:, 0]
        self._horizontal_mps = self._get("vel_accuracy")[:, 0]
        self._imu_to_base = se3.inverse(T_BASE_IMU)[:3, 3]
        self._positions = self._find_positions()

    def series(self, start_ns: int) -> list[Series]:
        """Its topics."""
        stamps_ns, poses = self._stamps_ns, (self._positions, self._quats)
        return [
            *moving_series(start_ns, stamps_ns, *poses),
            Series("/imu/data", Imu, stamps_ns, self.imu),
            Series("/gps/fix", NavSatFix, stamps_ns, self.fix),
            Series("/gps/vel", TwistStamped, stamps_ns, self.velocity),
            Series("/odom", Odometry, stamps_ns, self.odometry),
        ]

    def imu(self, index: int) -> Imu:
        """REP 145: measured along and about the IMU's own axes; attitude in east, north, up."""
        return Imu(
            quat_xyzw=self._quats[index],
            angular_xyz=self._rates[index],
            linear_xyz=self._get("ax", "ay", "az")[index],
            header=self._header(index, IMU),
        )

    def fix(self, index: int) -> NavSatFix:
        """The position of the IMU; its error in height is not given, and taken as twice that."""
        latitude, longitude, altitude = self._rows[index, :3].tolist()
        return NavSatFix(
            latitude,
            longitude,
            altitude,
            covariance=_covariance(self._horizontal_m[index]),
            covariance_type=_APPROXIMATED,
            status=self._status(index),
            header=self._header(index, IMU),
        )

    def velocity(self, index: int) -> TwistStamped:
        """Linear and angular velocity of the IMU in the axes of odom: east, north, up."""
        angular = self._R[index] @ self._rates[index]
        return TwistStamped(self._enu_mps[index], angular, self._header(index, ODOM))

    def odometry(self, index: int) -> Odometry:
        """Pose of base_link, and its velocity in its own axes; unknown covariances are 0."""
        lever = np.cross(self._rates[index], self._imu_to_base)
        pose, twist = np.zeros((6, 6)), np.zeros((6, 6))
        pose[:3, :3] = _covariance(self._horizontal_m[index])
        twist[:3, :3] = self._R[index].T @ _covariance(self._horizontal_mps[index]) @ self._R[index]
        return Odometry(
            self._positions[index],
            self._quats[index],
            linear_xyz=self._R[index].T @ self._enu_mps[index] + lever,
            angular_xyz=self._rates[index],
            pose_covariance=pose,
            twist_covariance=twist,
            child_frame_id=BASE,
            header=self._header(index, ODOM),
        )

    def _find_positions(self) -> Floats:
        first_latitude = float(self._rows[0, _AT["lat"]])
        imu = geodesy.kitti_mercator(self._get("lat", "lon", "alt"), first_latitude)
        base = imu + self._R @ self._imu_to_base
        moved: Floats = base - base[0]
        return moved

    def _status(self, index: int) -> int:
        navstat, posmode = (int(self._rows[index, _AT[name]]) for name in ("navstat", "posmode"))
        return _STATUS.get(posmode, _FIX) if navstat >= _LOCKING else _NO_FIX

    def _header(self, index: int, frame_id: str) -> Header:
        return Header(int(self._stamps_ns[index]), frame_id)

    def _get(self, *names: str) -> Floats:
        return self._rows[:, [_AT[name] for name in names]]


def _covariance(horizontal: float) -> Floats:
    """Covariance east, north, up from the standard deviation of east and of north."""
    deviations = np.array([horizontal, horizontal, horizontal * _VERTICAL])
    covariance: Floats = np.diag(deviations**2)
    return covariance
