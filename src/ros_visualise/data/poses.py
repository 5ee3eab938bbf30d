"""Poses, velocities, paths and transforms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import repeat
from operator import attrgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import (
    Columns,
    field_names,
    header,
    read_header,
    read_time,
    times,
)
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.ros_fields import TabledMessage, columns


@dataclass(frozen=True, eq=False)
class PoseStamped(TabledMessage):
    """A pose in the frame of its header: position (3,) in metres, quaternion (4,)."""

    type_name = "geometry_msgs/msg/PoseStamped"
    ros_fields = ros.table(pose=ros.POSE)

    position_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Odometry(TabledMessage):
    """A pose in the frame of its header, and velocities in the frame ``child_frame_id``.

    ``position_xyz`` (3,) in metres and ``quat_xyzw`` (4,); ``linear_xyz`` (3,) in m/s and
    ``angular_xyz`` (3,) in rad/s; covariances 6x6 in the order x, y, z, and rotations about them.
    """

    type_name = "nav_msgs/msg/Odometry"
    ros_fields = ros.table(
        child_frame_id=str,
        pose=ros.pose_with_covariance("pose_covariance"),
        twist=ros.twist_with_covariance("twist_covariance"),
    )

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

    type_name = "geometry_msgs/msg/PoseWithCovarianceStamped"
    ros_fields = ros.table(pose=ros.pose_with_covariance("covariance"))

    position_xyz: Floats
    quat_xyzw: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class TwistStamped(TabledMessage):
    """Velocities in the frame of the header: (3,) in m/s and (3,) in rad/s."""

    type_name = "geometry_msgs/msg/TwistStamped"
    ros_fields = ros.table(twist=ros.TWIST)

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class TwistWithCovarianceStamped(TabledMessage):
    """A `TwistStamped` with its covariance, 6x6 in the order of linear and angular velocity."""

    type_name = "geometry_msgs/msg/TwistWithCovarianceStamped"
    ros_fields = ros.table(twist=ros.twist_with_covariance("covariance"))

    linear_xyz: Floats
    angular_xyz: Floats
    covariance: Floats = field(default_factory=lambda: np.zeros((6, 6)))
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Twist(TabledMessage):
    """Commanded velocities, as on ``cmd_vel``: (3,) in m/s and (3,) in rad/s.

    The ROS message has no header; this one's is not sent on a ROS graph.
    """

    type_name = "geometry_msgs/msg/Twist"
    has_header = False
    ros_fields = ros.table(linear=ros.vector("linear_xyz"), angular=ros.vector("angular_xyz"))

    linear_xyz: Floats
    angular_xyz: Floats
    header: Header = Header()


_POSITION = attrgetter("position.x", "position.y", "position.z")
_ORIENTATION = attrgetter("orientation.x", "orientation.y", "orientation.z", "orientation.w")


@dataclass(frozen=True, eq=False)
class Path(Message):
    """Poses in the frame of its header, in the order of travel.

    ``stamps_ns`` (N,), ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    type_name = "nav_msgs/msg/Path"
    plotted = False

    stamps_ns: npt.NDArray[np.int64]
    positions_xyz: Floats
    quats_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        count = len(self.stamps_ns)
        keep(self, np.int64, stamps_ns=(count,))
        keep(self, positions_xyz=(count, 3), quats_xyzw=(count, 4))

    def fields(self) -> dict[str, Any]:
        count = len(self.stamps_ns)
        headers = {
            "seq": repeat(0, count),
            "stamp": times(self.stamps_ns),
            "frame_id": repeat(self.header.frame_id, count),
        }
        stamped = {
            "header": Columns("std_msgs/msg/Header", count, headers),
            "pose": _write_poses(self.positions_xyz, self.quats_xyzw),
        }
        return {
            "header": header(self.header),
            "poses": Columns("geometry_msgs/msg/PoseStamped", count, stamped),
        }

    @classmethod
    def read(cls, message: Any) -> Path:
        """The path in a ROS message; its poses are assumed to be in its own frame."""
        stamps_ns = np.array([read_time(one.header.stamp) for one in message.poses], np.int64)
        positions_xyz, quats_xyzw = _read_poses([one.pose for one in message.poses])
        return cls(stamps_ns, positions_xyz, quats_xyzw, read_header(message.header))


@dataclass(frozen=True, eq=False)
class PoseArray(Message):
    """Poses in the frame of its header, unordered: possible poses of something.

    ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    type_name = "geometry_msgs/msg/PoseArray"
    also_read = ("nav2_msgs/msg/ParticleCloud",)  # by amcl of ROS 2
    plotted = False

    positions_xyz: Floats
    quats_xyzw: Floats
    header: Header = Header()

    def __post_init__(self) -> None:
        count = len(self.positions_xyz)
        keep(self, positions_xyz=(count, 3), quats_xyzw=(count, 4))

    def fields(self) -> dict[str, Any]:
        return {
            "header": header(self.header),
            "poses": _write_poses(self.positions_xyz, self.quats_xyzw),
        }

    @classmethod
    def read(cls, message: Any) -> PoseArray:
        """The poses in a PoseArray, or in a ParticleCloud without its weights."""
        weighted = "particles" in field_names(message.__class__)
        poses = [one.pose for one in message.particles] if weighted else message.poses
        return cls(*_read_poses(poses), read_header(message.header))


def _write_poses(positions_xyz: Floats, quats_xyzw: Floats) -> Columns:
    poses = {
        "position": columns("geometry_msgs/msg/Point", positions_xyz),
        "orientation": columns("geometry_msgs/msg/Quaternion", quats_xyzw, "xyzw"),
    }
    return Columns("geometry_msgs/msg/Pose", len(positions_xyz), poses)


def _read_poses(poses: Sequence[Any]) -> tuple[Floats, Floats]:
    """Positions (N, 3) and quaternions (N, 4)."""
    return (
        np.array([_POSITION(one) for one in poses], np.float64).reshape(-1, 3),
        np.array([_ORIENTATION(one) for one in poses], np.float64).reshape(-1, 4),
    )


@dataclass(frozen=True, eq=False)
class TransformStamped(TabledMessage):
    """Pose of the frame ``child_frame_id`` in the frame of the header: T_parent_child.

    ``translation_xyz`` (3,) in metres and ``quat_xyzw`` (4,) take points of the child frame to the
    frame of the header.
    """

    type_name = "geometry_msgs/msg/TransformStamped"
    ros_fields = ros.table(
        child_frame_id=str,
        transform=ros.SubMessage(
            "geometry_msgs/msg/Transform",
            translation=ros.vector("translation_xyz"),
            rotation=ros.quaternion("quat_xyzw"),
        ),
    )

    child_frame_id: str
    translation_xyz: Floats
    quat_xyzw: Floats
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Transforms(TabledMessage):
    """Several transforms sent at once, as on ``/tf``."""

    type_name = "tf2_msgs/msg/TFMessage"
    also_read = ("tf/msg/tfMessage",)
    plotted = False
    ros_fields = ros.table(transforms=ros.several("transforms", TransformStamped))

    transforms: tuple[TransformStamped, ...]

    @property
    def header(self) -> Header:
        """Header of the first transform; empty without any."""
        return self.transforms[0].header if self.transforms else Header()


def is_static(topic: str) -> bool:
    """True if the transforms on a topic hold at all times, by its name."""
    return topic.rstrip("/").endswith("tf_static")


def is_transforms(topic: str) -> bool:
    """True if a topic holds transforms of frames that move, by its name."""
    return topic.rstrip("/").rpartition("/")[2] == "tf"
