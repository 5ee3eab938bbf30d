"""Several poses, ordered or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import repeat
from operator import attrgetter
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.message import Message
from ros_visualise.data.fields import (
    Columns,
    field_names,
    header,
    read_header,
    read_time,
    times,
)
from ros_visualise.data.header import Floats, Header, keep
from ros_visualise.data.ros_fields import columns

_POSITION = attrgetter("position.x", "position.y", "position.z")
_ORIENTATION = attrgetter("orientation.x", "orientation.y", "orientation.z", "orientation.w")


@dataclass(frozen=True, eq=False)
class Path(Message):
    """Poses in the frame of its header, in the order of travel.

    ``stamps_ns`` (N,), ``positions_xyz`` (N, 3) in metres, ``quats_xyzw`` (N, 4).
    """

    type_name: ClassVar[str] = "nav_msgs/msg/Path"
    plotted: ClassVar[bool] = False

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

    type_name: ClassVar[str] = "geometry_msgs/msg/PoseArray"
    also_read: ClassVar[tuple[str, ...]] = ("nav2_msgs/msg/ParticleCloud",)  # by amcl of ROS 2
    plotted: ClassVar[bool] = False

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
