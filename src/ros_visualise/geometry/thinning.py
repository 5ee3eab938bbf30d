"""Fewer points of a line or a series, chosen so that what they show stays the same."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, Path

Indices = npt.NDArray[np.intp]

_TINY = float(np.finfo(np.float64).tiny)


def simplify(points: Floats, errors_m: Floats, count: int) -> tuple[Indices, Floats]:
    """Choose the points of a polyline that keep its shape best, the ends among them.

    Starting with the line between the ends, the piece with the largest error is split at its
    farthest point until there are ``count``. Earlier errors add up, so that the bound stays true
    however often a polyline is simplified.

    Args:
        points: (N, D), metres; N of at least 2.
        errors_m: (N - 1,): largest distance of points removed earlier from the line between two
            neighbours.
        count: number of points to keep; at least 2.

    Returns:
        Indices of the kept points, ascending, and for the lines between them (count - 1,) the
        largest distance of any removed point from its line.

    Source: D. Douglas and T. Peucker, "Algorithms for the reduction of the number of points
    required to represent a digitized line", Cartographica 10(2), 1973; here the pieces are split in
    the order of their errors, until a number is reached instead of a tolerance.
    """
    if len(points) <= count:
        return np.arange(len(points)), errors_m
    pieces = [_measure(points, errors_m, 0, len(points) - 1)]
    while len(pieces) + 1 < count:
        piece = heapq.heappop(pieces)
        heapq.heappush(pieces, _measure(points, errors_m, piece.first, piece.split))
        heapq.heappush(pieces, _measure(points, errors_m, piece.split, piece.last))
    pieces.sort(key=lambda piece: piece.first)
    kept = np.array([0, *(piece.last for piece in pieces)], np.intp)
    return kept, np.array([piece.error_m for piece in pieces])


def evenly(total: int, count: int) -> Indices:
    """Choose at most so many of a number of things, evenly, the first and the last among them."""
    return np.linspace(0, total - 1, min(total, count)).astype(np.intp)


class _Segment(NamedTuple):
    """The line between two points; the first one in a heap is to be split next."""

    order: float
    first: int
    last: int
    split: int
    error_m: float


def _measure(points: Floats, errors_m: Floats, first: int, last: int) -> _Segment:
    away = _distances(points[first : last + 1])
    farthest = int(away.argmax())
    # No point of a line is farther from another line than the farther one of its ends.
    error = float((np.maximum(away[:-1], away[1:]) + errors_m[first:last]).max())
    if last - first == 1:
        return _Segment(math.inf, first, last, last, error)
    if not away[farthest]:
        return _Segment(0.0, first, last, (first + last) // 2, error)
    return _Segment(-error, first, last, first + farthest, error)


def _distances(points: Floats) -> Floats:
    """Distances of points (N, D) from the line between the first and the last of them."""
    apart = points - points[0]  # before anything is squared: coordinates may be large
    line = apart[-1]
    along = (apart @ line / max(line @ line, _TINY)).clip(0, 1)
    rest = apart - along[:, None] * line
    away: Floats = np.sqrt((rest * rest).sum(axis=1))
    away[0] = away[-1] = 0
    return away


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
