"""What sensors other than cameras measure <-> messages of sensor_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import (
    FluidPressure,
    Imu,
    LaserScan,
    MagneticField,
    NavSatFix,
    TimeReference,
)
from ros_visualise.messages.build import Fields, header, read_header, read_time, time
from ros_visualise.messages.poses import named, xyz, xyzw

_OF_SCAN = (
    "angle_min",
    "angle_max",
    "angle_increment",
    "time_increment",
    "scan_time",
    "range_min",
    "range_max",
)


def write_imu(imu: Imu) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/Imu."""
    return {
        "header": header(imu.header),
        "orientation": named("geometry_msgs/msg/Quaternion", imu.quat_xyzw),
        "orientation_covariance": imu.orientation_covariance.ravel(),
        "angular_velocity": named("geometry_msgs/msg/Vector3", imu.angular_xyz),
        "angular_velocity_covariance": imu.angular_covariance.ravel(),
        "linear_acceleration": named("geometry_msgs/msg/Vector3", imu.linear_xyz),
        "linear_acceleration_covariance": imu.linear_covariance.ravel(),
    }


def read_imu(message: Any) -> Imu:
    """The measurement in a sensor_msgs/msg/Imu."""
    return Imu(
        quat_xyzw=np.array(xyzw(message.orientation)),
        angular_xyz=np.array(xyz(message.angular_velocity)),
        linear_xyz=np.array(xyz(message.linear_acceleration)),
        orientation_covariance=_square(message.orientation_covariance),
        angular_covariance=_square(message.angular_velocity_covariance),
        linear_covariance=_square(message.linear_acceleration_covariance),
        header=read_header(message.header),
    )


def write_fix(fix: NavSatFix) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/NavSatFix."""
    status = {"status": fix.status, "service": fix.service}
    return {
        "header": header(fix.header),
        "status": Fields("sensor_msgs/msg/NavSatStatus", status),
        "latitude": fix.latitude,
        "longitude": fix.longitude,
        "altitude": fix.altitude,
        "position_covariance": fix.covariance.ravel(),
        "position_covariance_type": fix.covariance_type,
    }


def read_fix(message: Any) -> NavSatFix:
    """The position in a sensor_msgs/msg/NavSatFix."""
    return NavSatFix(
        latitude=float(message.latitude),
        longitude=float(message.longitude),
        altitude=float(message.altitude),
        covariance=_square(message.position_covariance),
        covariance_type=int(message.position_covariance_type),
        status=int(message.status.status),
        service=int(message.status.service),
        header=read_header(message.header),
    )


def write_magnetic_field(magnetic: MagneticField) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/MagneticField."""
    return {
        "header": header(magnetic.header),
        "magnetic_field": named("geometry_msgs/msg/Vector3", magnetic.field_xyz),
        "magnetic_field_covariance": magnetic.covariance.ravel(),
    }


def read_magnetic_field(message: Any) -> MagneticField:
    """The measurement in a sensor_msgs/msg/MagneticField."""
    return MagneticField(
        field_xyz=np.array(xyz(message.magnetic_field)),
        covariance=_square(message.magnetic_field_covariance),
        header=read_header(message.header),
    )


def write_pressure(pressure: FluidPressure) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/FluidPressure."""
    return {
        "header": header(pressure.header),
        "fluid_pressure": pressure.pressure,
        "variance": pressure.variance,
    }


def read_pressure(message: Any) -> FluidPressure:
    """The measurement in a sensor_msgs/msg/FluidPressure."""
    return FluidPressure(
        float(message.fluid_pressure), float(message.variance), read_header(message.header)
    )


def write_scan(scan: LaserScan) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/LaserScan."""
    return {
        "header": header(scan.header),
        **{name: getattr(scan, name) for name in _OF_SCAN},
        "ranges": np.ascontiguousarray(scan.ranges),
        "intensities": np.ascontiguousarray(scan.intensities),
    }


def read_scan(message: Any) -> LaserScan:
    """The distances in a sensor_msgs/msg/LaserScan."""
    return LaserScan(
        ranges=np.asarray(message.ranges, np.float32),
        intensities=np.asarray(message.intensities, np.float32),
        header=read_header(message.header),
        **{name: float(getattr(message, name)) for name in _OF_SCAN},
    )


def write_time_reference(reference: TimeReference) -> dict[str, Any]:
    """The fields of a sensor_msgs/msg/TimeReference."""
    return {
        "header": header(reference.header),
        "time_ref": time(reference.time_ns),
        "source": reference.source,
    }


def read_time_reference(message: Any) -> TimeReference:
    """The time in a sensor_msgs/msg/TimeReference."""
    stamp_ns = read_time(message.time_ref)
    return TimeReference(stamp_ns, str(message.source), read_header(message.header))


def _square(covariance: Any) -> npt.NDArray[np.float64]:
    return np.array(covariance, np.float64).reshape(3, 3)
