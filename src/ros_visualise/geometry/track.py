"""Poses of a path, in bounded memory."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Header, Path
from ros_visualise.geometry.thinning import Indices, simplify


class ThinnedPath:
    """Poses (x, y, z and a quaternion x, y, z, w), each appended in amortized constant time.

    Beyond the maximum, the older half is thinned to half its poses. Paths that `path` gave stay as
    they are: rows are only added, or copied to a larger array.

    Attributes:
        deviation_m: the largest distance of a removed pose from the line of the path.
    """

    def __init__(self) -> None:
        self._poses = np.zeros((0, 7))
        self._stamps_ns = np.zeros(0, np.int64)
        self._errors_m = np.zeros(0)
        self._count = 0
        self.deviation_m = 0.0

    def __len__(self) -> int:
        return self._count

    def is_apart(self, pose: Floats, distance_m: float, angle_rad: float) -> bool:
        """True if a pose is that far from the last one, or rotated by that angle."""
        if not self._count:
            return True
        last = self._poses[self._count - 1]
        moved_m = math.dist(pose[:3], last[:3])
        return moved_m >= distance_m or _angle(pose[3:], last[3:]) >= angle_rad

    def append(self, stamp_ns: int, pose: Floats, max_poses: int) -> None:
        """Add a pose (7,); from ``max_poses`` on, at least 8, the oldest ones are thinned."""
        if self._count >= max_poses:
            self._thin(max_poses)
        if self._count == len(self._poses):
            self._move(np.arange(self._count), room=self._count + 64)
        self._poses[self._count] = pose
        self._stamps_ns[self._count] = stamp_ns
        self._errors_m[self._count] = 0  # of the line to the next pose
        self._count += 1

    def path(self, header: Header) -> Path:
        """The poses as they are now."""
        poses = self._poses[: self._count]
        return Path(self._stamps_ns[: self._count], poses[:, :3], poses[:, 3:], header)

    def _thin(self, max_poses: int) -> None:
        half = self._count - max_poses // 2
        errors_m = self._errors_m[: half - 1]
        kept, now_errors_m = simplify(self._poses[:half, :3], errors_m, max_poses // 4)
        self._move(np.concatenate([kept, np.arange(half, self._count)]), room=max_poses // 4)
        self._errors_m[: len(now_errors_m)] = now_errors_m
        self.deviation_m = float(self._errors_m[: self._count].max())

    def _move(self, kept: Indices, room: int) -> None:
        """Copy these poses to arrays with room for so many more."""
        self._poses = np.concatenate([self._poses[kept], np.empty((room, 7))])
        self._stamps_ns = np.concatenate([self._stamps_ns[kept], np.empty(room, np.int64)])
        self._errors_m = np.concatenate([self._errors_m[kept], np.zeros(room)])
        self._count = len(kept)


def _angle(quat: Floats, other: Floats) -> float:
    """Angle between two attitudes, 0 where one of them is missing (all zero)."""
    scale = math.sqrt(quat @ quat) * math.sqrt(other @ other)
    return 2 * math.acos(min(abs(float(quat @ other)) / scale, 1.0)) if scale else 0.0
