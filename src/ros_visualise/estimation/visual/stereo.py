"""Stereo pairs: which images belong together, and where the right camera is."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

import numpy as np

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.geometry.frames import FrameTree

_TOGETHER_NS = 20_000_000
_WAITING = 8  # images of one camera that wait for the other's

Item = TypeVar("Item")


class StereoPairs(Generic[Item]):
    """Joins the images of two cameras by their stamps, in whatever order they come."""

    def __init__(self) -> None:
        self._waiting: tuple[deque[tuple[int, Item]], ...] = (
            deque(maxlen=_WAITING),
            deque(maxlen=_WAITING),
        )

    def add(self, stamp_ns: int, item: Item, is_right: bool) -> tuple[Item, Item] | None:
        """Add an image; it and its partner, the left one first, if that has come."""
        own, others = self._waiting[is_right], self._waiting[not is_right]
        near = min(others, key=lambda one: abs(one[0] - stamp_ns), default=None)
        if near is None or abs(near[0] - stamp_ns) > _TOGETHER_NS:
            own.append((stamp_ns, item))
            return None
        while others.popleft() is not near:
            pass
        own.clear()
        return (near[1], item) if is_right else (item, near[1])


def right_of(left: CameraInfo, right: CameraInfo, tree: FrameTree) -> Floats | None:
    """T_left_right of a camera to the right of another, by the projections of both or by tf.

    None if neither places it there.
    """
    offsets = [one.projection[0, 3] / one.projection[0, 0] for one in (left, right)]
    T = np.eye(4)
    T[0, 3] = offsets[0] - offsets[1]
    if not T[0, 3]:
        try:
            T = np.asarray(tree.lookup(left.header.frame_id, right.header.frame_id, 0))
        except NoTransform:
            return None
    is_right = T[0, 3] > 2 * np.hypot(T[1, 3], T[2, 3])
    return T if is_right and np.trace(T[:3, :3]) > 2.9 else None
