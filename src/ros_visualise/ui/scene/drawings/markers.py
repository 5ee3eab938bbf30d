"""Markers in the scene: those of a topic that were added and not deleted, each at its place."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Marker, MarkerAction, MarkerArray, MarkerType
from ros_visualise.geometry import transforms
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.scene.drawing import Drawing, Look, move
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.marker_nodes import add_node, looks_like
from ros_visualise.ui.scene.solid_batch import SolidBatch
from ros_visualise.ui.scene.solids import Solids, mesh_of, solids_of

_MOST = 5000  # markers of a topic; of more the oldest go
_TRIES = 5  # for the transform at a marker's own stamp, before the newest has to do
_LEVEL = np.array([0.0, 0, 0, 1])
_KINDS = ("cube", "sphere", "cylinder", "cone")
_Key = tuple[str, int]


@dataclass
class _Kept:
    """A marker that is there: until when, where, and what is drawn of it.

    ``T_fixed_marker`` is where it is drawn, if it is; ``solids`` are what it is made of, once that
    was asked for, and ``node`` is there where it is made of none.
    """

    marker: Marker
    until_ns: float
    tries: int = 0
    T_fixed_frame: Floats | None = None
    node: viser.FrameHandle | None = None
    solids: list[Solids] | None = None
    T_fixed_marker: Floats | None = None

    @property
    def follows(self) -> bool:
        """Whether it moves with its frame."""
        return self.marker.frame_locked or not self.marker.header.stamp_ns


class Markers(Drawing):
    """The markers of a topic, of a `Marker` or a `MarkerArray` at a time."""

    draws = (Marker, MarkerArray)

    stays = True
    gathers: ClassVar[bool] = True

    def __init__(self, scene: viser.SceneApi, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._kept: dict[_Key, _Kept] = {}
        self._gone: dict[_Key, _Kept] = {}  # while a message is taken in: it may add them again
        self._changed: dict[_Key, _Kept] = {}  # is to be drawn anew
        self._batches = {
            kind: SolidBatch(scene, f"{name}/{kind}", *mesh_of(kind)) for kind in _KINDS
        }
        self._count = 0
        self._fixed = ""
        self._problems: dict[_Key, str] = {}

    def gather(self, message: Any, now_ns: int) -> None:
        """Do what a message says; what is drawn changes with the next `update`."""
        for marker in message.markers if isinstance(message, MarkerArray) else (message,):
            if marker.action == MarkerAction.DELETEALL:
                self._clear(marker.ns)
            elif marker.action == MarkerAction.ADD:
                self._add(marker, now_ns)
            else:
                self._remove((marker.ns, marker.id))
        while len(self._kept) > _MOST:
            self._remove(next(iter(self._kept)))
        self._let_go()

    def draw(self, message: Any, look: Look) -> None:
        """Nothing: a message is gathered as soon as it comes."""

    def frame_of(self, message: Any, frames: Frames) -> str:
        """The fixed one: each marker has a frame of its own."""
        return ""

    def update(self, frames: Frames, now_ns: int) -> str:
        """Let markers end and move; why some are not drawn."""
        for key in [key for key, one in self._kept.items() if one.until_ns <= now_ns]:
            self._remove(key)
        self._let_go()
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
        """The names that can be read there."""
        markers = (one.marker for one in self._kept.values())
        return {one.text for one in markers if one.type == MarkerType.TEXT_VIEW_FACING}

    def extent(self) -> npt.NDArray[np.floating]:
        outlines = [
            transforms.apply(one.T_fixed_marker, _outline(one.marker))
            for one in self._kept.values()
            if one.T_fixed_marker is not None
        ]
        return np.concatenate([np.zeros((0, 3)), *outlines])

    def reset(self) -> None:
        self._clear("")
        self._let_go()

    def _place(self, key: _Key, one: _Kept, frames: Frames, newest: dict[str, Floats]) -> None:
        """Find out where a marker's frame is, unless that is known for good.

        Args:
            newest: frame -> where it is now, as far as that was asked for in this round.
        """
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
        """Draw what changed of the markers that are there."""
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
        """Draw a marker in the place of what was drawn of it; nothing where it is nowhere."""
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
        """Draw nothing of a marker."""
        for batch in self._batches.values():
            batch.drop(key)
        if one.node is not None:
            one.node.remove()
        one.node = one.T_fixed_marker = None

    def _show_node(self, one: _Kept, T_fixed_marker: Floats) -> None:
        if one.node is None:
            self._count += 1
            name = f"{self._name}/{self._count}"
            node = self._scene.add_frame(name, show_axes=False)
            try:
                add_node(self._scene, f"{name}/shape", one.marker)
            except ValueError:
                node.remove()
                raise
            one.node = node
        move(one.node, T_fixed_marker)

    def _add(self, marker: Marker, now_ns: int) -> None:
        """Take a marker in; of one that only moves, what is drawn of it moves."""
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
        """Delete all markers of a namespace; without a name, of all."""
        for key in [key for key in self._kept if ns in ("", key[0])]:
            self._remove(key)

    def _let_go(self) -> None:
        """Take off the scene what was removed and not added again."""
        for key, one in self._gone.items():
            if key not in self._kept:
                self._hide(key, one)
            elif one.node is not None:
                one.node.remove()
        self._gone.clear()


def _locate(one: _Kept, frames: Frames, newest: dict[str, Floats]) -> Floats:
    """T_fixed_frame of its frame: now, or at its stamp, or now where that cannot be said."""
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
        raise ValueError("holds a value that is not a number")
    quat_xyzw = marker.quat_xyzw if marker.quat_xyzw.any() else _LEVEL
    return transforms.from_pose(marker.position_xyz, quat_xyzw)


def _outline(marker: Marker) -> npt.NDArray[np.floating]:
    """Some points that tell how large it is."""
    if len(marker.points_xyz):
        return marker.points_xyz[:: -(-len(marker.points_xyz) // 100)]
    return np.array([-0.5, 0.5])[:, None] * marker.scale_xyz
