"""Our data <-> ROS messages: one table, and whoever calls brings the message classes.

    message = to_message(image, typestore.types)
    image = from_message(message, Image)

``types`` maps names as ``sensor_msgs/msg/Image`` to classes that are made from their fields in
order, as a rosbags typestore's ``types`` does; genpy's classes fit too.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from ros_visualise.data import (
    CameraInfo,
    CompressedImage,
    Header,
    Image,
    Odometry,
    ParameterEvent,
    Path,
    PoseStamped,
)
from ros_visualise.messages import images, parameters, poses
from ros_visualise.messages.build import Fields, Types, build

T = TypeVar("T")


class _Row(NamedTuple):
    type_name: str
    write: Callable[[Any, Header], dict[str, Any]]
    read: Callable[[Any], Any]


_TABLE: dict[type, _Row] = {
    Image: _Row("sensor_msgs/msg/Image", images.write_image, images.read_image),
    CompressedImage: _Row(
        "sensor_msgs/msg/CompressedImage", images.write_compressed, images.read_compressed
    ),
    CameraInfo: _Row(
        "sensor_msgs/msg/CameraInfo", images.write_camera_info, images.read_camera_info
    ),
    Odometry: _Row("nav_msgs/msg/Odometry", poses.write_odometry, poses.read_odometry),
    Path: _Row("nav_msgs/msg/Path", poses.write_path, poses.read_path),
    PoseStamped: _Row(
        "geometry_msgs/msg/PoseStamped", poses.write_pose_stamped, poses.read_pose_stamped
    ),
    ParameterEvent: _Row(
        "rcl_interfaces/msg/ParameterEvent",
        parameters.write_parameter_event,
        parameters.read_parameter_event,
    ),
}


def type_name(data_class: type) -> str:
    """The ROS type for a class of ours: ``sensor_msgs/msg/Image`` for `Image`."""
    return _TABLE[data_class].type_name


def data_class(type_name: str) -> type | None:
    """Our class for a ROS type, or None where there is none."""
    return next((cls for cls, row in _TABLE.items() if row.type_name == type_name), None)


def to_message(data: Any, types: Types, header: Header | None = None) -> Any:
    """The ROS message for ``data``.

    The pixels of an image are passed on as they lie in memory, without a copy.

    Args:
        data: one of our messages.
        types: ROS type name -> class.
        header: for a `CameraInfo`, which has none of its own: that of its image.

    Raises:
        ValueError: its stamp is one that ROS cannot hold.
    """
    row = _TABLE[type(data)]
    return build(Fields(row.type_name, row.write(data, header or Header())), types)


def from_message(message: Any, data_class: type[T]) -> T:
    """Our message for a ROS message of ``type_name(data_class)``.

    The pixels of an image are those of the message, which must not be changed any more.

    Raises:
        ValueError: it contradicts itself, or holds what ``data_class`` cannot.
    """
    read: Callable[[Any], T] = _TABLE[data_class].read
    return read(message)
