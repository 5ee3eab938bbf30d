"""The poses of one frame in another, from a stream of transforms."""

from __future__ import annotations

from collections import deque

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Transforms
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.transforms import to_pose

_WAITING = 10_000
"""Stamps that may wait until all of the chain is known then."""


class FramePair:
    """Follows one frame in another at the stamps of every transform between them that moves.

    Args:
        parent, child: names of the frames; the poses are those of the child in the parent.
    """

    def __init__(self, parent: str, child: str) -> None:
        self.parent, self.child = parent, child
        self.reset()

    def reset(self) -> None:
        """Begin anew: time jumped."""
        self._waiting: deque[tuple[int, str]] = deque(maxlen=_WAITING)
        self._last_ns: int | None = None
        self._newest_ns: int | None = None

    def follow(self, tree: FrameTree, message: Transforms) -> list[tuple[int, Floats]]:
        """The stamps at which the chain is known by now, and was not before, and the poses (7,).

        Args:
            tree: what is known of the frames, with the message.
            message: transforms that move, of whatever frames.
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
        """The pose at a time; none where a part of the chain begins only later."""
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
