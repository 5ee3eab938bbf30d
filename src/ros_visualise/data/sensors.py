"""Measurements of sensors other than cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.header import Floats, Header
from ros_visualise.data.ros_fields import TabledMessage

_SCAN_NUMBERS = (
    "angle_min",
    "angle_max",
    "angle_increment",
    "time_increment",
    "scan_time",
    "range_min",
    "range_max",
)


@dataclass(frozen=True, eq=False)
class Imu(TabledMessage):
    """Attitude, angular velocities and accelerations in the frame of the header (REP 145).

    ``quat_xyzw`` (4,), ``angular_xyz`` (3,) in rad/s, ``linear_xyz`` (3,) in m/s^2, gravity
    included: at rest +9.8 upwards. Covariances are 3x3; all zero means unknown, a first
    element of -1 that the field is not measured.
    """

    type_name = "sensor_msgs/msg/Imu"
    ros_fields = ros.table(
        orientation=ros.quaternion("quat_xyzw"),
        orientation_covariance=ros.array("orientation_covariance", 3, 3),
        angular_velocity=ros.vector("angular_xyz"),
        angular_velocity_covariance=ros.array("angular_covariance", 3, 3),
        linear_acceleration=ros.vector("linear_xyz"),
        linear_acceleration_covariance=ros.array("linear_covariance", 3, 3),
    )

    quat_xyzw: Floats
    angular_xyz: Floats
    linear_xyz: Floats
    orientation_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    angular_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    linear_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class NavSatFix(TabledMessage):
    """A position on the WGS 84 ellipsoid: degrees, and metres above the ellipsoid.

    ``status`` and ``covariance_type`` are those of sensor_msgs/NavSatFix: a status below 0 is no
    fix. ``covariance`` is 3x3 in m^2, east, north, up. ``service`` are the systems used, as bits.
    """

    type_name = "sensor_msgs/msg/NavSatFix"
    ros_fields = ros.table(
        status=ros.SubMessage("sensor_msgs/msg/NavSatStatus", status=int, service=int),
        latitude=float,
        longitude=float,
        altitude=float,
        position_covariance=ros.array("covariance", 3, 3),
        position_covariance_type=ros.Attribute("covariance_type", int),
    )

    latitude: float
    longitude: float
    altitude: float
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    covariance_type: int = 0
    status: int = 0
    service: int = 1
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class MagneticField(TabledMessage):
    """The magnetic field (3,) in tesla in the frame of the header; covariance 3x3."""

    type_name = "sensor_msgs/msg/MagneticField"
    ros_fields = ros.table(
        magnetic_field=ros.vector("field_xyz"),
        magnetic_field_covariance=ros.array("covariance", 3, 3),
    )

    field_xyz: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()


@dataclass(frozen=True)
class FluidPressure(TabledMessage):
    """A pressure in pascal, and its variance in pascal^2."""

    type_name = "sensor_msgs/msg/FluidPressure"
    ros_fields = ros.table(fluid_pressure=ros.Attribute("pressure", float), variance=float)

    pressure: float
    variance: float = 0.0
    header: Header = Header()


@dataclass(frozen=True)
class Range(TabledMessage):
    """A distance in metres along the x axis of the frame of the header (REP 117).

    ``radiation_type`` is 0 for ultrasound and 1 for infrared; ``field_of_view`` is the width of the
    beam in radians. ``variance`` in m^2 is 0 where it is unknown; ROS 1 has no field for it.
    """

    type_name = "sensor_msgs/msg/Range"
    ros_fields = ros.table(
        radiation_type=int,
        field_of_view=float,
        min_range=float,
        max_range=float,
        range=float,
        variance=float,
    )

    range: float
    min_range: float
    max_range: float
    field_of_view: float = 0.0
    radiation_type: int = 1
    variance: float = 0.0
    header: Header = Header()

    @classmethod
    def read(cls, message: Any) -> Range:
        names = [name for name in cls.ros_fields if name != "variance" or hasattr(message, name)]
        found: dict[str, Any] = {}
        for name in names:
            cls.ros_fields[name].read(getattr(message, name), found)
        return cls(**found)


@dataclass(frozen=True, eq=False)
class LaserScan(TabledMessage):
    """Distances in metres along rays in the x-y plane of the frame of the header (REP 117).

    ``ranges`` (N,): ray number i points to ``angle_min + i * angle_increment`` radians; values
    outside ``range_min`` to ``range_max`` are no measurements. ``intensities`` (N,), or empty.
    """

    type_name = "sensor_msgs/msg/LaserScan"
    ros_fields = ros.table(
        **dict.fromkeys(_SCAN_NUMBERS, float),
        ranges=ros.array("ranges", -1, dtype=np.float32),
        intensities=ros.array("intensities", -1, dtype=np.float32),
    )

    ranges: npt.NDArray[np.float32]
    angle_min: float
    angle_max: float
    angle_increment: float
    range_min: float
    range_max: float
    intensities: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))
    time_increment: float = 0.0
    scan_time: float = 0.0
    header: Header = Header()


@dataclass(frozen=True)
class TimeReference(TabledMessage):
    """Another clock's time, ``time_ns``, at the stamp of the header; ``source`` names the clock."""

    type_name = "sensor_msgs/msg/TimeReference"
    ros_fields = ros.table(time_ref=ros.stamp("time_ns"), source=str)

    time_ns: int
    source: str = ""
    header: Header = Header()


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class JointState(TabledMessage):
    """Positions (N,) in rad or m, velocities, and efforts in N m or N; each may be empty."""

    type_name = "sensor_msgs/msg/JointState"
    ros_fields = ros.table(
        name=ros.Attribute("names", lambda names: tuple(map(str, names)), list),
        position=ros.array("positions", -1),
        velocity=ros.array("velocities", -1),
        effort=ros.array("efforts", -1),
    )

    names: tuple[str, ...]
    positions: Floats
    velocities: Floats = field(default_factory=_none)
    efforts: Floats = field(default_factory=_none)
    header: Header = Header()

    def __post_init__(self) -> None:
        super().__post_init__()
        for values in (self.positions, self.velocities, self.efforts):
            if len(values) not in (0, len(self.names)):
                raise ValueError(f"{len(values)} values for {len(self.names)} joints")

    @property
    def positions_by_name(self) -> Mapping[str, float]:
        """Joint -> its position, of those that have one."""
        pairs = zip(self.names, self.positions.tolist(), strict=False)
        return {name: position for name, position in pairs if np.isfinite(position)}
