"""The classes of ROS 1's own Python messages, for `ros_visualise.messages`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import genpy
from geometry_msgs import msg as geometry_msgs
from nav_msgs import msg as nav_msgs
from sensor_msgs import msg as sensor_msgs
from std_msgs import msg as std_msgs
from tf2_msgs import msg as tf2_msgs

from ros_visualise.errors import UsageError
from ros_visualise.messages import type_name

_CLASSES = (
    std_msgs.Header,
    std_msgs.String,
    sensor_msgs.CameraInfo,
    sensor_msgs.CompressedImage,
    sensor_msgs.FluidPressure,
    sensor_msgs.Image,
    sensor_msgs.Imu,
    sensor_msgs.LaserScan,
    sensor_msgs.MagneticField,
    sensor_msgs.NavSatFix,
    sensor_msgs.NavSatStatus,
    sensor_msgs.PointCloud2,
    sensor_msgs.PointField,
    sensor_msgs.RegionOfInterest,
    sensor_msgs.TimeReference,
    geometry_msgs.Point,
    geometry_msgs.Point32,
    geometry_msgs.Polygon,
    geometry_msgs.PolygonStamped,
    geometry_msgs.Vector3,
    geometry_msgs.Quaternion,
    geometry_msgs.Pose,
    geometry_msgs.PoseArray,
    geometry_msgs.PoseStamped,
    geometry_msgs.PoseWithCovariance,
    geometry_msgs.PoseWithCovarianceStamped,
    geometry_msgs.Transform,
    geometry_msgs.TransformStamped,
    geometry_msgs.Twist,
    geometry_msgs.TwistStamped,
    geometry_msgs.TwistWithCovariance,
    nav_msgs.MapMetaData,
    nav_msgs.OccupancyGrid,
    nav_msgs.Odometry,
    nav_msgs.Path,
    tf2_msgs.TFMessage,
)

TYPES: Mapping[str, Any] = {
    "builtin_interfaces/msg/Time": genpy.Time,
    **{cls._type.replace("/", "/msg/"): cls for cls in _CLASSES},
}
"""ROS type name, as ``sensor_msgs/msg/Image`` -> class."""


def message_class(data_class: type) -> Any:
    """The class of the messages that a topic of ``data_class`` has.

    Raises:
        UsageError: ROS 1 has none.
    """
    found = TYPES.get(type_name(data_class))
    if found is None:
        raise UsageError(f"ROS 1 has no message for {data_class.__name__}")
    return found
