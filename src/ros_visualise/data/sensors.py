"""What sensors other than cameras measure."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, header, read_header, read_time, time
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.vectors import named, xyz, xyzw

_OF_SCAN = (
    "angle_min",
    "angle_max",
    "angle_increment",
    "time_increment",
    "scan_time",
    "range_min",
    "range_max",
)


@dataclass(frozen=True, eq=False)
class Imu(Message):
    """Attitude, turn rates and accelerations in the frame of the header (REP 145).

    ``quat_xyzw`` (4,), ``angular_xyz`` (3,) in rad/s, ``linear_xyz`` (3,) in m/s^2, gravity
    included: at rest +9.8 upwards. Covariances are 3x3; all zero means that it is not known, a
    first element of -1 that the field is not measured at all.
    """

    type_name: ClassVar[str] = "sensor_msgs/msg/Imu"

    quat_xyzw: Floats
    angular_xyz: Floats
    linear_xyz: Floats
    orientation_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    angular_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    linear_covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(
            self,
            quat_xyzw=(4,),
            angular_xyz=(3,),
            linear_xyz=(3,),
            orientation_covariance=(3, 3),
            angular_covariance=(3, 3),
            linear_covariance=(3, 3),
        )

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/Imu."""
        return {
            "header": header(self.header),
            "orientation": named("geometry_msgs/msg/Quaternion", self.quat_xyzw),
            "orientation_covariance": self.orientation_covariance.ravel(),
            "angular_velocity": named("geometry_msgs/msg/Vector3", self.angular_xyz),
            "angular_velocity_covariance": self.angular_covariance.ravel(),
            "linear_acceleration": named("geometry_msgs/msg/Vector3", self.linear_xyz),
            "linear_acceleration_covariance": self.linear_covariance.ravel(),
        }

    @classmethod
    def read(cls, message: Any) -> Imu:
        """The measurement in a sensor_msgs/msg/Imu."""
        return cls(
            quat_xyzw=np.array(xyzw(message.orientation)),
            angular_xyz=np.array(xyz(message.angular_velocity)),
            linear_xyz=np.array(xyz(message.linear_acceleration)),
            orientation_covariance=_square(message.orientation_covariance),
            angular_covariance=_square(message.angular_velocity_covariance),
            linear_covariance=_square(message.linear_acceleration_covariance),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class NavSatFix(Message):
    """A position on the WGS 84 ellipsoid: degrees, and metres above the ellipsoid.

    ``status`` and ``covariance_type`` are those of sensor_msgs/NavSatFix: a status below 0 is no
    fix. ``covariance`` is 3x3 in m^2, east, north, up. ``service`` are the systems used, as bits.
    """

    type_name: ClassVar[str] = "sensor_msgs/msg/NavSatFix"

    latitude: float
    longitude: float
    altitude: float
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    covariance_type: int = 0
    status: int = 0
    service: int = 1
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, covariance=(3, 3))

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/NavSatFix."""
        status = {"status": self.status, "service": self.service}
        return {
            "header": header(self.header),
            "status": Fields("sensor_msgs/msg/NavSatStatus", status),
            "latitude": self.latitude,
            "longitude": self.longitude,
            "altitude": self.altitude,
            "position_covariance": self.covariance.ravel(),
            "position_covariance_type": self.covariance_type,
        }

    @classmethod
    def read(cls, message: Any) -> NavSatFix:
        """The position in a sensor_msgs/msg/NavSatFix."""
        return cls(
            latitude=float(message.latitude),
            longitude=float(message.longitude),
            altitude=float(message.altitude),
            covariance=_square(message.position_covariance),
            covariance_type=int(message.position_covariance_type),
            status=int(message.status.status),
            service=int(message.status.service),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class MagneticField(Message):
    """The magnetic field (3,) in tesla in the frame of the header; covariance 3x3."""

    type_name: ClassVar[str] = "sensor_msgs/msg/MagneticField"

    field_xyz: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, field_xyz=(3,), covariance=(3, 3))

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/MagneticField."""
        return {
            "header": header(self.header),
            "magnetic_field": named("geometry_msgs/msg/Vector3", self.field_xyz),
            "magnetic_field_covariance": self.covariance.ravel(),
        }

    @classmethod
    def read(cls, message: Any) -> MagneticField:
        """The measurement in a sensor_msgs/msg/MagneticField."""
        return cls(
            field_xyz=np.array(xyz(message.magnetic_field)),
            covariance=_square(message.magnetic_field_covariance),
            header=read_header(message.header),
        )


@dataclass(frozen=True)
class FluidPressure(Message):
    """A pressure in pascal, and its variance in pascal^2."""

    type_name: ClassVar[str] = "sensor_msgs/msg/FluidPressure"

    pressure: float
    variance: float = 0.0
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/FluidPressure."""
        return {
            "header": header(self.header),
            "fluid_pressure": self.pressure,
            "variance": self.variance,
        }

    @classmethod
    def read(cls, message: Any) -> FluidPressure:
        """The measurement in a sensor_msgs/msg/FluidPressure."""
        return cls(
            float(message.fluid_pressure), float(message.variance), read_header(message.header)
        )


@dataclass(frozen=True, eq=False)
class LaserScan(Message):
    """Distances in metres along rays in the x-y plane of the frame of the header (REP 117).

    ``ranges`` (N,): ray number i points to ``angle_min + i * angle_increment`` radians; what lies
    outside ``range_min`` to ``range_max`` is no measurement. ``intensities`` (N,), or empty.
    """

    type_name: ClassVar[str] = "sensor_msgs/msg/LaserScan"

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

    def __post_init__(self) -> None:
        keep(self, np.float32, ranges=(len(self.ranges),), intensities=(len(self.intensities),))

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/LaserScan."""
        return {
            "header": header(self.header),
            **{name: getattr(self, name) for name in _OF_SCAN},
            "ranges": np.ascontiguousarray(self.ranges),
            "intensities": np.ascontiguousarray(self.intensities),
        }

    @classmethod
    def read(cls, message: Any) -> LaserScan:
        """The distances in a sensor_msgs/msg/LaserScan."""
        return cls(
            ranges=np.asarray(message.ranges, np.float32),
            intensities=np.asarray(message.intensities, np.float32),
            header=read_header(message.header),
            **{name: float(getattr(message, name)) for name in _OF_SCAN},
        )


@dataclass(frozen=True)
class TimeReference(Message):
    """Another time, ``time_ns``, that goes with the stamp of the header; ``source`` names it."""

    type_name: ClassVar[str] = "sensor_msgs/msg/TimeReference"

    time_ns: int
    source: str = ""
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a sensor_msgs/msg/TimeReference."""
        return {
            "header": header(self.header),
            "time_ref": time(self.time_ns),
            "source": self.source,
        }

    @classmethod
    def read(cls, message: Any) -> TimeReference:
        """The time in a sensor_msgs/msg/TimeReference."""
        stamp_ns = read_time(message.time_ref)
        return cls(stamp_ns, str(message.source), read_header(message.header))


def _square(covariance: Any) -> npt.NDArray[np.float64]:
    return np.array(covariance, np.float64).reshape(3, 3)
