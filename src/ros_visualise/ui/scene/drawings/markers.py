"""Markers: those that a topic has added and not deleted."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Marker, MarkerAction, MarkerArray, MarkerType
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import SpaceNode
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, move
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.marker_nodes import add_node, looks_like
from ros_visualise.ui.scene.solids import MarkerSolids, SolidBatch, solids_of

_MOST = 5000  # markers of a topic; of more the oldest go
_TRIES = 5  # for the transform at a marker's own stamp, before the newest has to do
_LEVEL = np.array([0.0, 0, 0, 1])
_KINDS = ("cube", "sphere", "cylinder", "cone")
_Key = tuple[str, int]


@dataclass
class _Kept:
    """A present marker: until when, where, and its nodes.

    ``T_fixed_marker`` is set while it is drawn; ``solids`` are computed once; a marker that is not
    made of solids has a ``node``.
    """

    marker: Marker
    until_ns: float
    tries: int = 0
    T_fixed_frame: Floats | None = None
    node: SpaceNode | None = None
    solids: list[MarkerSolids] | None = None
    T_fixed_marker: Floats | None = None

    @property
    def follows(self) -> bool:
        """True if it moves with its frame."""
        return self.marker.frame_locked or not self.marker.header.stamp_ns


class MarkersDrawing(Drawing):
    """The markers of a topic of `Marker` or `MarkerArray`."""

    draws = (Marker, MarkerArray)

    stays = True
    gathers: ClassVar[bool] = True

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._kept: dict[_Key, _Kept] = {}
        self._gone: dict[_Key, _Kept] = {}  # removed by a message that may add them again
        self._changed: dict[_Key, _Kept] = {}  # to be drawn
        self._batches = {kind: SolidBatch(scene, f"{name}/{kind}", kind) for kind in _KINDS}
        self._count = 0
        self._fixed = ""
        self._problems: dict[_Key, str] = {}

    def gather(self, message: Any, now_ns: int) -> None:
        """Add, change and delete markers; the drawing changes with the next `update`."""
        for marker in message.markers if isinstance(message, MarkerArray) else (message,):
            if marker.action == MarkerAction.DELETEALL:
                self._clear(marker.ns)
            elif marker.action == MarkerAction.ADD:
                self._add(marker, now_ns)
            else:
                self._remove((marker.ns, marker.id))
        while len(self._kept) > _MOST:
            self._remove(next(iter(self._kept)))
        self._drop_gone()

    def draw(self, message: Any, appearance: Appearance) -> None:
        """Nothing to do: messages are gathered."""

    def frame_of(self, message: Any, frames: Frames) -> str:
        """The fixed one: each marker has a frame of its own."""
        return ""

    def update(self, frames: Frames, now_ns: int) -> str:
        """Remove expired markers and move the others; returns why some are not drawn."""
        for key in [key for key, one in self._kept.items() if one.until_ns <= now_ns]:
            self._remove(key)
        self._drop_gone()
        if frames.fixed != self._fixed:
            self._fixed = frames.fixed
            for key, one in self._kept.items():
                one.tries, one.T_fixed_frame = 0, None
                self._changed[key] = one
        newest: dict[str, Floats] = {}
        for key, one in self._kept.items():
            self._place(key, one, frames, newest)
        self._show()
        return next(iter(self._problems.values()), "")

    @property
    def texts(self) -> set[str]:
        markers = (one.marker for one in self._kept.values())
        return {one.text for one in markers if one.type == MarkerType.TEXT_VIEW_FACING}

    def extent(self) -> npt.NDArray[np.floating]:
        outlines = [
            se3.apply(one.T_fixed_marker, _outline(one.marker))
            for one in self._kept.values()
            if one.T_fixed_marker is not None
        ]
        return np.concatenate([np.zeros((0, 3)), *outlines])

    def reset(self) -> None:
        self._clear("")
        self._drop_gone()

    def _place(self, key: _Key, one: _Kept, frames: Frames, newest: dict[str, Floats]) -> None:
        """Locate a marker's frame, unless it stays; ``newest`` caches frames of this round."""
        before = one.T_fixed_frame
        if before is not None and one.tries >= _TRIES and not one.follows:
            return
        try:
            found = _locate(one, frames, newest)
        except NoTransform as error:
            self._problems[key] = str(error)
            return
        if before is None:
            self._problems.pop(key, None)
        if before is None or not np.array_equal(before, found):
            one.T_fixed_frame, self._changed[key] = found, one

    def _show(self) -> None:
        for key, one in self._changed.items():
            if self._kept.get(key) is not one:
                continue
            try:
                self._draw(key, one)
            except ValueError as error:
                self._hide(key, one)
                self._problems[key] = f"marker {one.marker.ns}/{one.marker.id}: {error}"
        self._changed.clear()
        for batch in self._batches.values():
            batch.show()

    def _draw(self, key: _Key, one: _Kept) -> None:
        """Draw a marker anew, or hide it while its frame is unknown."""
        if one.T_fixed_frame is None:
            self._hide(key, one)
            return
        T_fixed_marker = one.T_fixed_marker = one.T_fixed_frame @ pose_of(one.marker)
        if one.solids is None:
            one.solids = solids_of(one.marker)
        parts = {kind: (T_fixed_marker @ T, sizes, rgba) for kind, T, sizes, rgba in one.solids}
        for kind, batch in self._batches.items():
            if kind in parts:
                batch.put(key, parts[kind])
            else:
                batch.drop(key)
        if not parts:
            self._show_node(one, T_fixed_marker)

    def _hide(self, key: _Key, one: _Kept) -> None:
        for batch in self._batches.values():
            batch.drop(key)
        if one.node is not None:
            one.node.remove()
        one.node = one.T_fixed_marker = None

    def _show_node(self, one: _Kept, T_fixed_marker: Floats) -> None:
        if one.node is None:
            self._count += 1
            name = f"{self._name}/{self._count}"
            node = self._scene.add(name, SpaceNode())
            try:
                add_node(self._scene, f"{name}/shape", one.marker)
            except ValueError:
                node.remove()
                raise
            one.node = node
        move(one.node, T_fixed_marker)

    def _add(self, marker: Marker, now_ns: int) -> None:
        """Add a marker; one that only moves keeps its nodes."""
        key = marker.ns, marker.id
        until_ns = now_ns + marker.lifetime_ns if marker.lifetime_ns > 0 else math.inf
        self._remove(key)
        added, before = _Kept(marker, until_ns), self._gone.get(key)
        if before is not None and looks_like(before.marker, marker):
            added.node, before.node = before.node, None
            added.solids = before.solids
        self._kept[key] = self._changed[key] = added

    def _remove(self, key: _Key) -> None:
        one = self._kept.pop(key, None)
        self._problems.pop(key, None)
        if one is not None:
            self._gone[key] = one

    def _clear(self, ns: str) -> None:
        """Delete the markers of a namespace, or all for an empty name."""
        for key in [key for key in self._kept if ns in ("", key[0])]:
            self._remove(key)

    def _drop_gone(self) -> None:
        """Remove the nodes of markers that were not added again."""
        for key, one in self._gone.items():
            if key not in self._kept:
                self._hide(key, one)
            elif one.node is not None:
                one.node.remove()
        self._gone.clear()


def _locate(one: _Kept, frames: Frames, newest: dict[str, Floats]) -> Floats:
    """T_fixed_frame of its frame: at its stamp, or the newest."""
    frame = one.marker.header.frame_id
    one.tries += 1
    if not one.follows:
        with suppress(NoTransform):
            found = frames.locate(frame, one.marker.header.stamp_ns, patient=True)
            one.tries = _TRIES
            return found
    if frame not in newest:
        newest[frame] = frames.locate(frame, 0)
    return newest[frame]


def pose_of(marker: Marker) -> Floats:
    """T_frame_marker, 4x4; a quaternion of zeros, which many programs send, means no rotation.

    Raises:
        ValueError: a value is not a number.
    """
    parts = (marker.position_xyz, marker.quat_xyzw, marker.scale_xyz, marker.points_xyz.ravel())
    if not np.isfinite(np.concatenate(parts)).all():
        raise ValueError("has a value that is not a number")
    quat_xyzw = marker.quat_xyzw if marker.quat_xyzw.any() else _LEVEL
    return se3.from_pose(marker.position_xyz, quat_xyzw)


def _outline(marker: Marker) -> npt.NDArray[np.floating]:
    """Some points that span it."""
    if len(marker.points_xyz):
        return marker.points_xyz[:: -(-len(marker.points_xyz) // 100)]
    return np.array([-0.5, 0.5])[:, None] * marker.scale_xyz
