"""The messages that travel between nodes: frozen dataclasses on numpy arrays.

A message is never changed after it was made, so it passes between threads by reference.
"""

from ros_visualise.data.frames import Transforms, TransformStamped
from ros_visualise.data.header import Floats, Header, Pixels
from ros_visualise.data.images import (
    ENCODINGS,
    MEASUREMENTS,
    CameraInfo,
    CompressedImage,
    Deferred,
    Image,
)
from ros_visualise.data.maps import OccupancyGrid, PolygonStamped
from ros_visualise.data.parameters import ParameterEvent
from ros_visualise.data.poses import (
    Odometry,
    Path,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    Twist,
    TwistStamped,
)
from ros_visualise.data.sensors import (
    FluidPressure,
    Imu,
    LaserScan,
    MagneticField,
    NavSatFix,
    PointCloud,
    TimeReference,
)
from ros_visualise.data.text import Text

MESSAGES: tuple[type, ...] = (
    CameraInfo,
    FluidPressure,
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
    TransformStamped,
    Transforms,
    Twist,
    TwistStamped,
)
"""What can travel on a topic: each has a `Header`."""

__all__ = [
    "ENCODINGS",
    "MEASUREMENTS",
    "MESSAGES",
    "CameraInfo",
    "CompressedImage",
    "Deferred",
    "Floats",
    "FluidPressure",
    "Header",
    "Image",
    "Imu",
    "LaserScan",
    "MagneticField",
    "NavSatFix",
    "OccupancyGrid",
    "Odometry",
    "ParameterEvent",
    "Path",
    "Pixels",
    "PointCloud",
    "PolygonStamped",
    "PoseArray",
    "PoseStamped",
    "PoseWithCovarianceStamped",
    "Text",
    "TimeReference",
    "TransformStamped",
    "Transforms",
    "Twist",
    "TwistStamped",
]
