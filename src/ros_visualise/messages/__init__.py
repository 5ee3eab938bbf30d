"""Our data <-> ROS messages: one table, and whoever calls brings the message classes.

    message = to_message(image, typestore.types)
    image = from_message(message, Image)

``types`` maps names as ``sensor_msgs/msg/Image`` to classes that are made from their fields in
order, as a rosbags typestore's ``types`` does; genpy's classes fit too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from ros_visualise.data import (
    CameraInfo,
    CompressedImage,
    FluidPressure,
    Header,
    Image,
    Imu,
    LaserScan,
    MagneticField,
    NavSatFix,
    OccupancyGrid,
    Odometry,
    ParameterEvent,
    Path,
    PointCloud,
    PolygonStamped,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    Text,
    TimeReference,
    Transforms,
    TransformStamped,
    Twist,
    TwistStamped,
)
from ros_visualise.messages import (
    clouds,
    frames,
    images,
    maps,
    parameters,
    paths,
    poses,
    sensors,
    text,
)
from ros_visualise.messages.build import Fields, Types, build

T = TypeVar("T")


class _Row(NamedTuple):
    type_name: str
    write: Callable[[Any], dict[str, Any]]
    read: Callable[[Any], Any]


_TABLE: dict[type, _Row] = {
    CameraInfo: _Row(
        "sensor_msgs/msg/CameraInfo", images.write_camera_info, images.read_camera_info
    ),
    CompressedImage: _Row(
        "sensor_msgs/msg/CompressedImage", images.write_compressed, images.read_compressed
    ),
    FluidPressure: _Row(
        "sensor_msgs/msg/FluidPressure", sensors.write_pressure, sensors.read_pressure
    ),
    Image: _Row("sensor_msgs/msg/Image", images.write_image, images.read_image),
    Imu: _Row("sensor_msgs/msg/Imu", sensors.write_imu, sensors.read_imu),
    LaserScan: _Row("sensor_msgs/msg/LaserScan", sensors.write_scan, sensors.read_scan),
    MagneticField: _Row(
        "sensor_msgs/msg/MagneticField", sensors.write_magnetic_field, sensors.read_magnetic_field
    ),
    NavSatFix: _Row("sensor_msgs/msg/NavSatFix", sensors.write_fix, sensors.read_fix),
    OccupancyGrid: _Row("nav_msgs/msg/OccupancyGrid", maps.write_grid, maps.read_grid),
    Odometry: _Row("nav_msgs/msg/Odometry", poses.write_odometry, poses.read_odometry),
    ParameterEvent: _Row(
        "rcl_interfaces/msg/ParameterEvent",
        parameters.write_parameter_event,
        parameters.read_parameter_event,
    ),
    Path: _Row("nav_msgs/msg/Path", paths.write_path, paths.read_path),
    PointCloud: _Row("sensor_msgs/msg/PointCloud2", clouds.write_cloud, clouds.read_cloud),
    PolygonStamped: _Row("geometry_msgs/msg/PolygonStamped", maps.write_polygon, maps.read_polygon),
    PoseArray: _Row("geometry_msgs/msg/PoseArray", paths.write_pose_array, paths.read_pose_array),
    PoseStamped: _Row(
        "geometry_msgs/msg/PoseStamped", poses.write_pose_stamped, poses.read_pose_stamped
    ),
    PoseWithCovarianceStamped: _Row(
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        poses.write_uncertain_pose,
        poses.read_uncertain_pose,
    ),
    Text: _Row("std_msgs/msg/String", text.write_text, text.read_text),
    TimeReference: _Row(
        "sensor_msgs/msg/TimeReference",
        sensors.write_time_reference,
        sensors.read_time_reference,
    ),
    Transforms: _Row("tf2_msgs/msg/TFMessage", frames.write_transforms, frames.read_transforms),
    TransformStamped: _Row(
        "geometry_msgs/msg/TransformStamped", frames.write_transform, frames.read_transform
    ),
    Twist: _Row("geometry_msgs/msg/Twist", poses.write_twist, poses.read_twist),
    TwistStamped: _Row(
        "geometry_msgs/msg/TwistStamped", poses.write_twist_stamped, poses.read_twist_stamped
    ),
}

_CLASSES: dict[str, type] = {
    "tf/msg/tfMessage": Transforms,  # what tf sent before tf2, with the same fields
    "nav2_msgs/msg/ParticleCloud": PoseArray,  # what amcl sends in ROS 2, with weights
    **{row.type_name: cls for cls, row in _TABLE.items()},
}


def type_name(data_class: type) -> str:
    """The ROS type for a class of ours: ``sensor_msgs/msg/Image`` for `Image`."""
    return _TABLE[data_class].type_name


def data_class(type_name: str) -> type | None:
    """Our class for a ROS type, or None where there is none."""
    return _CLASSES.get(type_name)


def to_message(data: Any, types: Types, header: Header | None = None) -> Any:
    """The ROS message for ``data``.

    The pixels of an image and the points of a cloud are passed on as they lie in memory, without
    a copy.

    Args:
        data: one of our messages.
        types: ROS type name -> class.
        header: in place of its own.

    Raises:
        ValueError: it holds what the message cannot, such as a stamp before 1970.
    """
    row = _TABLE[type(data)]
    if header is not None:
        data = replace(data, header=header)
    return build(Fields(row.type_name, row.write(data)), types)


def from_message(message: Any, data_class: type[T]) -> T:
    """Our message for a ROS message of ``type_name(data_class)``.

    Pixels and points are those of the message, which must not be changed any more.

    Raises:
        ValueError: it contradicts itself, or holds what ``data_class`` cannot.
    """
    read: Callable[[Any], T] = _TABLE[data_class].read
    return read(message)
