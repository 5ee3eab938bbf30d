"""Poses and velocities."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.header import Floats, Header
from ros_visualise.data.ros_fields import TabledMessage


@dataclass(frozen=True, eq=False)
class PoseStamped(TabledMessage):
    """A pose in the frame of its header: position (3,) in metres, quaternion (4,)."""

    type_name: ClassVar[str] = "geometry_msgs/msg/PoseStamped"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        "pose": ros.POSE,
    }

    position_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Odometry(TabledMessage):
    """A pose in the frame of its header, and velocities in the frame ``child_frame_id``.

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,); ``linear_xyz`` (3,) in m/s and
    ``angular_xyz`` (3,) in rad/s; covariances 6x6 in the order x, y, z, and rotations about them.
    """

    type_name: ClassVar[str] = "nav_msgs/msg/Odometry"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        **ros.plain(child_frame_id=str),
        "pose": ros.pose_with_covariance("pose_covariance"),
        "twist": ros.Part(
            "geometry_msgs/msg/TwistWithCovariance",
            twist=ros.TWIST,
            covariance=ros.array("twist_covariance", 6, 6),
        ),
    }

    position_xyz: Floats
    quat_xyzw: Floats
    linear_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    angular_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    pose_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    twist_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    child_frame_id: str = ""
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class PoseWithCovarianceStamped(TabledMessage):
    """A `PoseStamped` with its covariance, 6x6 in the order x, y, z, rotations."""

    type_name: ClassVar[str] = "geometry_msgs/msg/PoseWithCovarianceStamped"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        "pose": ros.pose_with_covariance("covariance"),
    }

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class TwistStamped(TabledMessage):
    """Velocities in the frame of the header: (3,) in m/s and (3,) in rad/s."""

    type_name: ClassVar[str] = "geometry_msgs/msg/TwistStamped"
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        "twist": ros.TWIST,
    }

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Twist(TabledMessage):
    """Commanded velocities, as on ``cmd_vel``: (3,) in m/s and (3,) in rad/s.

    The ROS message has no header; this one's is not sent on a ROS graph.
    """

    type_name: ClassVar[str] = "geometry_msgs/msg/Twist"
    has_header: ClassVar[bool] = False
    ros_fields: ClassVar[ros.RosFields] = {
        "linear": ros.vector("linear_xyz"),
        "angular": ros.vector("angular_xyz"),
    }

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()
