"""The path that a robot has gone, from its odometry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ros_visualise.data import Floats, Header, Odometry, Path
from ros_visualise.nodes import node
from ros_visualise.params import param
from ros_visualise.rate import Clock, Pacer, WallClock


@dataclass(frozen=True)
class PathParams:
    """Parameters of `PathNode`."""

    min_distance: float = param(
        0.05, "metres to the last pose from which on a pose is kept", min=0, max=100, slider=(0, 2)
    )
    min_angle: float = param(
        5.0, "or degrees turned since then; 0 keeps every pose", min=0, max=180, slider=(0, 45)
    )
    max_poses: int = param(
        10_000,
        "poses in the path; beyond it the oldest go",
        min=1,
        max=1_000_000,
        slider=(1, 20_000),
    )
    rate: float = param(
        5.0, "paths per second at most, by the stamps; 0 is one for each pose", min=0, max=100
    )


@node(
    "path",
    params=PathParams,
    inputs={"odom": Odometry},
    outputs={"path": Path},
    latched=("path",),
)
class PathNode:
    """The path that a robot has gone, begun anew when time jumps back or the frame changes."""

    def __init__(self, params: PathParams, clock: Clock | None = None) -> None:
        self._clock = clock or WallClock()
        self._refused = 0
        self.reset()

    def reset(self) -> None:
        """Begin a new path."""
        self._track = _Track()
        self._pacer = Pacer()
        self._header = Header()
        self._is_due = self._has_grown = False

    def step(self, odom: Odometry, params: PathParams) -> Path | None:
        """The path so far, when it has grown and it is time for it."""
        pose = np.concatenate([odom.position_xyz, odom.quat_xyzw])
        if not np.isfinite(pose).all():
            self._refused += 1
            return None
        if odom.header.frame_id != self._header.frame_id:
            self.reset()
        self._header = odom.header
        if self._track.is_apart(pose, params.min_distance, math.radians(params.min_angle)):
            self._track.append(odom.header.stamp_ns, pose, params.max_poses)
            self._has_grown = True
        if not params.rate or self._pacer.passes(self._time_ns(), params.rate):
            self._is_due = True
        return self.finish() if self._is_due else None

    def finish(self) -> Path | None:
        """The path, if it has grown since the last time."""
        if not self._has_grown:
            return None
        self._is_due = self._has_grown = False
        return self._track.path(self._header)

    def report(self) -> dict[str, Any]:
        """Poses in the path, and poses that are no numbers."""
        return {"poses": len(self._track), "refused": self._refused}

    def _time_ns(self) -> int:
        return self._header.stamp_ns or self._clock.monotonic_ns()


class _Track:
    """Poses (x, y, z and a quaternion x, y, z, w), each appended in constant time.

    What `path` gave stays as it is: rows are only ever added, or copied to where there is room.
    """

    def __init__(self) -> None:
        self._poses = np.zeros((0, 7))
        self._stamps_ns = np.zeros(0, np.int64)
        self._start = self._end = 0

    def __len__(self) -> int:
        return self._end - self._start

    def is_apart(self, pose: Floats, distance: float, angle: float) -> bool:
        """Whether a pose is that far from the last one, or turned by that angle in radians."""
        if not len(self):
            return True
        last = self._poses[self._end - 1]
        moved = np.linalg.norm(pose[:3] - last[:3])
        return bool(moved >= distance or _angle(pose[3:], last[3:]) >= angle)

    def append(self, stamp_ns: int, pose: Floats, max_poses: int) -> None:
        """Add a pose; of the oldest only so many stay."""
        if self._end == len(self._poses):
            self._make_room()
        self._poses[self._end] = pose
        self._stamps_ns[self._end] = stamp_ns
        self._end += 1
        self._start = max(self._start, self._end - max_poses)

    def path(self, header: Header) -> Path:
        """The poses as they are now."""
        kept = slice(self._start, self._end)
        poses = self._poses[kept]
        return Path(self._stamps_ns[kept], poses[:, :3], poses[:, 3:], header)

    def _make_room(self) -> None:
        kept, count = slice(self._start, self._end), len(self)
        room = count + 64
        self._poses = np.concatenate([self._poses[kept], np.empty((room, 7))])
        self._stamps_ns = np.concatenate([self._stamps_ns[kept], np.empty(room, np.int64)])
        self._start, self._end = 0, count


def _angle(quat: Floats, other: Floats) -> float:
    """The angle between two attitudes, 0 where one of them is none (all zero)."""
    scale = math.sqrt(quat @ quat) * math.sqrt(other @ other)
    return 2 * math.acos(min(abs(float(quat @ other)) / scale, 1.0)) if scale else 0.0
