"""Poses from messages, and from streams of transforms."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import (
    Floats,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.geometry.se3 import to_pose

Located = Odometry | PoseStamped | PoseWithCovarianceStamped | TransformStamped | NavSatFix

PLANE_FRAME = "map"
"""The frame of positions on the local plane: x east, y north, z up (REP 103, REP 105)."""

_FARTHEST_M = 1e12  # 64-bit numbers still resolve tenths of millimetres


class Locator:
    """Reads poses from messages; fixes are projected on the local plane of the first one.

    A fix has no attitude and gets that of the plane. If its altitude is not a number, the last
    one is used.

    Attributes:
        refused: number of messages with a position that is not finite, or impossibly far.
        without_fix: number of fixes whose status is "no fix".
    """

    def __init__(self) -> None:
        self.refused = self.without_fix = 0
        self.reset()

    def reset(self) -> None:
        """Start again: the next fix is the first one."""
        self._plane: LocalPlane | None = None
        self._altitude_m = 0.0

    def locate(self, message: Located) -> Floats | None:
        """Position and quaternion (7,): x, y, z in metres and x, y, z, w; None without a valid one.

        Those of a fix are in `PLANE_FRAME`, all others in the frame of the header.
        """
        if isinstance(message, NavSatFix) and message.status < 0:
            self.without_fix += 1
            return None
        found = self._read(message)
        if not (np.isfinite(found).all() and np.abs(found).max() < _FARTHEST_M):
            self.refused += 1
            return None
        return found

    def _read(self, message: Located) -> Floats:
        if isinstance(message, NavSatFix):
            return np.array([*self._on_plane(message), 0.0, 0.0, 0.0, 1.0])
        if isinstance(message, TransformStamped):
            return np.concatenate([message.translation_xyz, message.quat_xyzw])
        return np.concatenate([message.position_xyz, message.quat_xyzw])

    def _on_plane(self, fix: NavSatFix) -> Floats:
        place = np.array([fix.latitude, fix.longitude])
        if not (np.isfinite(place).all() and abs(place[0]) <= 90 and abs(place[1]) <= 360):
            return np.full(3, math.nan)
        if math.isfinite(fix.altitude):
            self._altitude_m = fix.altitude
        if self._plane is None:
            self._plane = LocalPlane(place[0], place[1], self._altitude_m)
        return self._plane.to_enu([*place, self._altitude_m])


_WAITING = 10_000
"""Maximum number of stamps that wait until the whole chain is known."""


class FramePair:
    """Follows one frame in another at the stamps of all moving transforms between them.

    Args:
        parent, child: names of the frames; the poses are those of the child in the parent.
    """

    def __init__(self, parent: str, child: str) -> None:
        self.parent, self.child = parent, child
        self.reset()

    def reset(self) -> None:
        """Start again: time jumped."""
        self._waiting: deque[tuple[int, str]] = deque(maxlen=_WAITING)
        self._last_ns: int | None = None
        self._newest_ns: int | None = None

    def follow(self, tree: FrameTree, message: Transforms) -> list[tuple[int, Floats]]:
        """New stamps at which the chain is known, and the poses (7,).

        Args:
            tree: the frames, including those of the message.
            message: moving transforms of any frames.
        """
        moved = [
            (one.header.stamp_ns, one.child_frame_id.lstrip("/")) for one in message.transforms
        ]
        self._waiting.extend(moved)
        known = self._known(tree, min((stamp_ns for stamp_ns, _ in moved), default=0))
        return [(stamp_ns, pose) for stamp_ns in known for pose in self._poses(tree, stamp_ns)]

    def _known(self, tree: FrameTree, oldest_ns: int) -> list[int]:
        try:
            newest_ns = tree.newest_ns(self.parent, self.child)
        except NoTransform:
            return []
        if newest_ns is None or (newest_ns == self._newest_ns and oldest_ns > newest_ns):
            return []
        self._newest_ns = newest_ns
        chain = self._chain(tree)
        known = {stamp for stamp, child in self._waiting if stamp <= newest_ns and child in chain}
        waiting = [one for one in self._waiting if one[0] > newest_ns]
        self._waiting = deque(waiting, maxlen=_WAITING)
        return sorted(stamp for stamp in known if self._last_ns is None or stamp > self._last_ns)

    def _poses(self, tree: FrameTree, stamp_ns: int) -> list[Floats]:
        """The pose at a time; empty if a part of the chain begins later."""
        try:
            T_parent_child = tree.lookup(self.parent, self.child, stamp_ns)
        except NoTransform:
            return []
        self._last_ns = stamp_ns
        return [np.concatenate(to_pose(T_parent_child))]

    def _chain(self, tree: FrameTree) -> set[str]:
        """The frames between the two that have a transform to their parents."""
        above_child, above_parent = (
            self._ancestors(tree, self.child),
            self._ancestors(tree, self.parent),
        )
        return set(above_child) ^ set(above_parent)

    def _ancestors(self, tree: FrameTree, frame: str) -> list[str]:
        found = [frame.lstrip("/")]
        while (above := tree.parent(found[-1])) is not None and above not in found:
            found.append(above)
        return found
