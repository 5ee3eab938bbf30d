"""Poses, odometry and paths <-> messages of geometry_msgs and nav_msgs."""

from __future__ import annotations

from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Header, Odometry, Path, PoseStamped
from ros_visualise.messages.build import (
    Columns,
    Fields,
    header,
    read_header,
    read_time,
    times,
)

Array = npt.NDArray[np.float64]


def write_odometry(odometry: Odometry, _: Header) -> dict[str, Any]:
    """The fields of a nav_msgs/msg/Odometry."""
    pose = {
        "pose": _pose(odometry.position_xyz, odometry.quat_xyzw),
        "covariance": odometry.pose_covariance.ravel(),
    }
    velocity = {
        "linear": _named("geometry_msgs/msg/Vector3", odometry.linear_xyz),
        "angular": _named("geometry_msgs/msg/Vector3", odometry.angular_xyz),
    }
    twist = {
        "twist": Fields("geometry_msgs/msg/Twist", velocity),
        "covariance": odometry.twist_covariance.ravel(),
    }
    return {
        "header": header(odometry.header),
        "child_frame_id": odometry.child_frame_id,
        "pose": Fields("geometry_msgs/msg/PoseWithCovariance", pose),
        "twist": Fields("geometry_msgs/msg/TwistWithCovariance", twist),
    }


def read_odometry(message: Any) -> Odometry:
    """The odometry in a nav_msgs/msg/Odometry."""
    pose, twist = message.pose, message.twist
    return Odometry(
        position_xyz=np.array(_xyz(pose.pose.position)),
        quat_xyzw=np.array(_xyzw(pose.pose.orientation)),
        linear_xyz=np.array(_xyz(twist.twist.linear)),
        angular_xyz=np.array(_xyz(twist.twist.angular)),
        pose_covariance=np.array(pose.covariance, np.float64).reshape(6, 6),
        twist_covariance=np.array(twist.covariance, np.float64).reshape(6, 6),
        child_frame_id=str(message.child_frame_id),
        header=read_header(message.header),
    )


def write_pose_stamped(pose: PoseStamped, _: Header) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/PoseStamped."""
    return {"header": header(pose.header), "pose": _pose(pose.position_xyz, pose.quat_xyzw)}


def read_pose_stamped(message: Any) -> PoseStamped:
    """The pose in a geometry_msgs/msg/PoseStamped."""
    pose = message.pose
    return PoseStamped(
        position_xyz=np.array(_xyz(pose.position)),
        quat_xyzw=np.array(_xyzw(pose.orientation)),
        header=read_header(message.header),
    )


def write_path(path: Path, _: Header) -> dict[str, Any]:
    """The fields of a nav_msgs/msg/Path, whose poses are all in its own frame."""
    count = len(path.stamps_ns)
    headers = {
        "seq": repeat(0, count),
        "stamp": times(path.stamps_ns),
        "frame_id": repeat(path.header.frame_id, count),
    }
    poses = {
        "position": _columns("geometry_msgs/msg/Point", path.positions_xyz),
        "orientation": _columns("geometry_msgs/msg/Quaternion", path.quats_xyzw),
    }
    stamped = {
        "header": Columns("std_msgs/msg/Header", count, headers),
        "pose": Columns("geometry_msgs/msg/Pose", count, poses),
    }
    return {
        "header": header(path.header),
        "poses": Columns("geometry_msgs/msg/PoseStamped", count, stamped),
    }


def read_path(message: Any) -> Path:
    """The path in a nav_msgs/msg/Path; its poses are taken to be in its own frame."""
    poses = message.poses
    return Path(
        stamps_ns=np.array([read_time(one.header.stamp) for one in poses], np.int64),
        positions_xyz=np.array([_xyz(one.pose.position) for one in poses]).reshape(-1, 3),
        quats_xyzw=np.array([_xyzw(one.pose.orientation) for one in poses]).reshape(-1, 4),
        header=read_header(message.header),
    )


def _pose(position_xyz: Array, quat_xyzw: Array) -> Fields:
    values = {
        "position": _named("geometry_msgs/msg/Point", position_xyz),
        "orientation": _named("geometry_msgs/msg/Quaternion", quat_xyzw),
    }
    return Fields("geometry_msgs/msg/Pose", values)


def _named(type_name: str, numbers: Array) -> Fields:
    return Fields(type_name, dict(zip("xyzw", numbers.tolist(), strict=False)))


def _columns(type_name: str, rows: Array) -> Columns:
    return Columns(type_name, len(rows), dict(zip("xyzw", rows.T.tolist(), strict=False)))


def _xyz(message: Any) -> tuple[float, float, float]:
    return message.x, message.y, message.z


def _xyzw(message: Any) -> tuple[float, float, float, float]:
    return message.x, message.y, message.z, message.w
