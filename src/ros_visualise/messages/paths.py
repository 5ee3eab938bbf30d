"""Paths and arrays of poses <-> messages of nav_msgs and geometry_msgs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Path, PoseArray
from ros_visualise.messages.build import (
    Columns,
    field_names,
    header,
    read_header,
    read_time,
    times,
)
from ros_visualise.messages.poses import columns, xyz, xyzw


def write_path(path: Path) -> dict[str, Any]:
    """The fields of a nav_msgs/msg/Path, whose poses are all in its own frame."""
    count = len(path.stamps_ns)
    headers = {
        "seq": repeat(0, count),
        "stamp": times(path.stamps_ns),
        "frame_id": repeat(path.header.frame_id, count),
    }
    stamped = {
        "header": Columns("std_msgs/msg/Header", count, headers),
        "pose": _write_poses(path.positions_xyz, path.quats_xyzw),
    }
    return {
        "header": header(path.header),
        "poses": Columns("geometry_msgs/msg/PoseStamped", count, stamped),
    }


def read_path(message: Any) -> Path:
    """The path in a nav_msgs/msg/Path; its poses are taken to be in its own frame."""
    stamps_ns = np.array([read_time(one.header.stamp) for one in message.poses], np.int64)
    positions_xyz, quats_xyzw = _read_poses([one.pose for one in message.poses])
    return Path(stamps_ns, positions_xyz, quats_xyzw, read_header(message.header))


def write_pose_array(several: PoseArray) -> dict[str, Any]:
    """The fields of a geometry_msgs/msg/PoseArray."""
    return {
        "header": header(several.header),
        "poses": _write_poses(several.positions_xyz, several.quats_xyzw),
    }


def read_pose_array(message: Any) -> PoseArray:
    """The poses in a geometry_msgs/msg/PoseArray, or in a nav2_msgs/msg/ParticleCloud.

    The particles' weights are left behind.
    """
    weighted = "particles" in field_names(message.__class__)
    poses = [one.pose for one in message.particles] if weighted else message.poses
    return PoseArray(*_read_poses(poses), read_header(message.header))


def _write_poses(positions_xyz: Floats, quats_xyzw: Floats) -> Columns:
    poses = {
        "position": columns("geometry_msgs/msg/Point", positions_xyz),
        "orientation": columns("geometry_msgs/msg/Quaternion", quats_xyzw),
    }
    return Columns("geometry_msgs/msg/Pose", len(positions_xyz), poses)


def _read_poses(poses: Sequence[Any]) -> tuple[Floats, Floats]:
    """Positions (N, 3) and quaternions (N, 4)."""
    return (
        np.array([xyz(one.position) for one in poses], np.float64).reshape(-1, 3),
        np.array([xyzw(one.orientation) for one in poses], np.float64).reshape(-1, 4),
    )
