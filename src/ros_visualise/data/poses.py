"""Where something is, and how it moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ros_visualise.core.message import Message
from ros_visualise.data.fields import Fields, header, read_header
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.vectors import named, pose_fields, xyz, xyzw


@dataclass(frozen=True, eq=False)
class PoseStamped(Message):
    """Where something is in the frame of its header: position (3,) in metres, quaternion (4,)."""

    type_name: ClassVar[str] = "geometry_msgs/msg/PoseStamped"

    position_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,))

    def fields(self) -> dict[str, Any]:
        """The fields of a geometry_msgs/msg/PoseStamped."""
        return {
            "header": header(self.header),
            "pose": pose_fields(self.position_xyz, self.quat_xyzw),
        }

    @classmethod
    def read(cls, message: Any) -> PoseStamped:
        """The pose in a geometry_msgs/msg/PoseStamped."""
        pose = message.pose
        return cls(
            position_xyz=np.array(xyz(pose.position)),
            quat_xyzw=np.array(xyzw(pose.orientation)),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class Odometry(Message):
    """A pose in the frame of its header, and velocities in the frame ``child_frame_id``.

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,); ``linear_xyz`` (3,) in m/s and
    ``angular_xyz`` (3,) in rad/s; covariances 6x6 in the order x, y, z, and rotations about them.
    """

    type_name: ClassVar[str] = "nav_msgs/msg/Odometry"

    position_xyz: Floats
    quat_xyzw: Floats
    linear_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    angular_xyz: Floats = field(default_factory=lambda: np.zeros(3))
    pose_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    twist_covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    child_frame_id: str = ""
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), linear_xyz=(3,), angular_xyz=(3,))
        keep(self, pose_covariance=(6, 6), twist_covariance=(6, 6))

    def fields(self) -> dict[str, Any]:
        """The fields of a nav_msgs/msg/Odometry."""
        twist = {
            "twist": _twist(self.linear_xyz, self.angular_xyz),
            "covariance": self.twist_covariance.ravel(),
        }
        return {
            "header": header(self.header),
            "child_frame_id": self.child_frame_id,
            "pose": _uncertain(self.position_xyz, self.quat_xyzw, self.pose_covariance),
            "twist": Fields("geometry_msgs/msg/TwistWithCovariance", twist),
        }

    @classmethod
    def read(cls, message: Any) -> Odometry:
        """The odometry in a nav_msgs/msg/Odometry."""
        pose, twist = message.pose, message.twist
        return cls(
            position_xyz=np.array(xyz(pose.pose.position)),
            quat_xyzw=np.array(xyzw(pose.pose.orientation)),
            linear_xyz=np.array(xyz(twist.twist.linear)),
            angular_xyz=np.array(xyz(twist.twist.angular)),
            pose_covariance=np.array(pose.covariance, np.float64).reshape(6, 6),
            twist_covariance=np.array(twist.covariance, np.float64).reshape(6, 6),
            child_frame_id=str(message.child_frame_id),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class PoseWithCovarianceStamped(Message):
    """A `PoseStamped` and how sure it is: covariance 6x6 in the order x, y, z, rotations."""

    type_name: ClassVar[str] = "geometry_msgs/msg/PoseWithCovarianceStamped"

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, position_xyz=(3,), quat_xyzw=(4,), covariance=(6, 6))

    def fields(self) -> dict[str, Any]:
        """The fields of a geometry_msgs/msg/PoseWithCovarianceStamped."""
        return {
            "header": header(self.header),
            "pose": _uncertain(self.position_xyz, self.quat_xyzw, self.covariance),
        }

    @classmethod
    def read(cls, message: Any) -> PoseWithCovarianceStamped:
        """The pose in a geometry_msgs/msg/PoseWithCovarianceStamped."""
        pose = message.pose.pose
        return cls(
            position_xyz=np.array(xyz(pose.position)),
            quat_xyzw=np.array(xyzw(pose.orientation)),
            covariance=np.array(message.pose.covariance, np.float64).reshape(6, 6),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class TwistStamped(Message):
    """Velocities in the frame of the header: (3,) in m/s and (3,) in rad/s."""

    type_name: ClassVar[str] = "geometry_msgs/msg/TwistStamped"

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, linear_xyz=(3,), angular_xyz=(3,))

    def fields(self) -> dict[str, Any]:
        """The fields of a geometry_msgs/msg/TwistStamped."""
        return {"header": header(self.header), "twist": _twist(self.linear_xyz, self.angular_xyz)}

    @classmethod
    def read(cls, message: Any) -> TwistStamped:
        """The velocities in a geometry_msgs/msg/TwistStamped."""
        twist = message.twist
        return cls(
            linear_xyz=np.array(xyz(twist.linear)),
            angular_xyz=np.array(xyz(twist.angular)),
            header=read_header(message.header),
        )


@dataclass(frozen=True, eq=False)
class Twist(Message):
    """Velocities asked for, as ``cmd_vel`` has them: (3,) in m/s and (3,) in rad/s.

    The message of ROS has no header; this one's is left behind on a ROS graph.
    """

    type_name: ClassVar[str] = "geometry_msgs/msg/Twist"
    has_header: ClassVar[bool] = False

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        keep(self, linear_xyz=(3,), angular_xyz=(3,))

    def fields(self) -> dict[str, Any]:
        """The fields of a geometry_msgs/msg/Twist."""
        return dict(_twist(self.linear_xyz, self.angular_xyz).values)

    @classmethod
    def read(cls, message: Any) -> Twist:
        """The velocities in a geometry_msgs/msg/Twist."""
        return cls(np.array(xyz(message.linear)), np.array(xyz(message.angular)))


def _uncertain(position_xyz: Floats, quat_xyzw: Floats, covariance: Floats) -> Fields:
    values = {"pose": pose_fields(position_xyz, quat_xyzw), "covariance": covariance.ravel()}
    return Fields("geometry_msgs/msg/PoseWithCovariance", values)


def _twist(linear_xyz: Floats, angular_xyz: Floats) -> Fields:
    values = {
        "linear": named("geometry_msgs/msg/Vector3", linear_xyz),
        "angular": named("geometry_msgs/msg/Vector3", angular_xyz),
    }
    return Fields("geometry_msgs/msg/Twist", values)
