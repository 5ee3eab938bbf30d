"""Poses and velocities <-> messages of geometry_msgs and nav_msgs."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import (
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Twist,
    TwistStamped,
)
from ros_visualise.messages.build import Columns, Fields, header, read_header

Array = npt.NDArray[np.float64]


def write_odometry(odometry: Odometry) -> dict[str, Any]:
    """The fields of a nav_msgs/msg/Odometry."""
    twist = {
        "twist": _twist(odometry.linear_xyz, odometry.angular_xyz),
        "covariance": odometry.twist_covariance.ravel(),
    }
    return {
        "header": header(odometry.header),
        "child_frame_id": odometry.child_frame_id,
        "pose": _uncertain(odometry.position_xyz, odometry.quat_xyzw, odometry.pose_covariance),
        "twist": Fields("geometry_msgs/msg/TwistWithCovariance", twist),
    }


def read_odometry(message: Any) -> Odometry:
    """The odometry in a nav_msgs/msg/Odometry."""
    pose, twist = message.pose, message.twist
    return Odometry(
        position_xyz=np.array(xyz(pose.pose.position)),
        quat_xyzw=np.array(xyzw(pose.pose.orientation)),
        linear_xyz=np.array(xyz(twist.twist.linear)),
        angular_xyz=np.array(xyz(twist.twist.angular)),
        pose_covariance=np.array(pose.covariance, np.float64).reshape(6, 6),
        twist_covariance=np.array(twist.covariance, np.float64).reshape(6, 6),
        child_frame_id=str(message.child_frame_id),
        header=read_header(message.header),
    )


def write_pose_stamped(pose: PoseStamped) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/PoseStamped."""
    return {"header": header(pose.header), "pose": pose_fields(pose.position_xyz, pose.quat_xyzw)}


def read_pose_stamped(message: Any) -> PoseStamped:
    """The pose in a geometry_msgs/msg/PoseStamped."""
    pose = message.pose
    return PoseStamped(
        position_xyz=np.array(xyz(pose.position)),
        quat_xyzw=np.array(xyzw(pose.orientation)),
        header=read_header(message.header),
    )


def write_uncertain_pose(pose: PoseWithCovarianceStamped) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/PoseWithCovarianceStamped."""
    return {
        "header": header(pose.header),
        "pose": _uncertain(pose.position_xyz, pose.quat_xyzw, pose.covariance),
    }


def read_uncertain_pose(message: Any) -> PoseWithCovarianceStamped:
    """The pose in a geometry_msgs/msg/PoseWithCovarianceStamped."""
    pose = message.pose.pose
    return PoseWithCovarianceStamped(
        position_xyz=np.array(xyz(pose.position)),
        quat_xyzw=np.array(xyzw(pose.orientation)),
        covariance=np.array(message.pose.covariance, np.float64).reshape(6, 6),
        header=read_header(message.header),
    )


def write_twist(twist: Twist) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/Twist."""
    return dict(_twist(twist.linear_xyz, twist.angular_xyz).values)


def read_twist(message: Any) -> Twist:
    """The velocities in a geometry_msgs/msg/Twist."""
    return Twist(np.array(xyz(message.linear)), np.array(xyz(message.angular)))


def write_twist_stamped(twist: TwistStamped) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/TwistStamped."""
    return {"header": header(twist.header), "twist": _twist(twist.linear_xyz, twist.angular_xyz)}


def read_twist_stamped(message: Any) -> TwistStamped:
    """The velocities in a geometry_msgs/msg/TwistStamped."""
    twist = message.twist
    return TwistStamped(
        linear_xyz=np.array(xyz(twist.linear)),
        angular_xyz=np.array(xyz(twist.angular)),
        header=read_header(message.header),
    )


def pose_fields(position_xyz: Array, quat_xyzw: Array) -> Fields:
    """A pose."""
    values = {
        "position": named("geometry_msgs/msg/Point", position_xyz),
        "orientation": named("geometry_msgs/msg/Quaternion", quat_xyzw),
    }
    return Fields("geometry_msgs/msg/Pose", values)


def named(type_name: str, numbers: Array) -> Fields:
    """A message of the fields x, y, z and perhaps w."""
    return Fields(type_name, dict(zip("xyzw", numbers.tolist(), strict=False)))


def columns(type_name: str, rows: npt.NDArray[np.floating]) -> Columns:
    """Messages of the fields x, y, z and perhaps w, one for each row."""
    return Columns(type_name, len(rows), dict(zip("xyzw", rows.T.tolist(), strict=False)))


def xyz(message: Any) -> tuple[float, float, float]:
    """The numbers of a point or a vector."""
    return message.x, message.y, message.z


def xyzw(message: Any) -> tuple[float, float, float, float]:
    """The numbers of a quaternion."""
    return message.x, message.y, message.z, message.w


def _uncertain(position_xyz: Array, quat_xyzw: Array, covariance: Array) -> Fields:
    values = {"pose": pose_fields(position_xyz, quat_xyzw), "covariance": covariance.ravel()}
    return Fields("geometry_msgs/msg/PoseWithCovariance", values)


def _twist(linear_xyz: Array, angular_xyz: Array) -> Fields:
    values = {
        "linear": named("geometry_msgs/msg/Vector3", linear_xyz),
        "angular": named("geometry_msgs/msg/Vector3", angular_xyz),
    }
    return Fields("geometry_msgs/msg/Twist", values)
