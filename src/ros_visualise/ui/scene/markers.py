"""Markers in the scene: those of a topic that were added and not deleted, each at its place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import Floats, Marker, MarkerAction, MarkerArray, MarkerType
from ros_visualise.errors import NoTransform
from ros_visualise.geometry import transforms
from ros_visualise.ui.colors import Color
from ros_visualise.ui.scene.drawing import Drawing, Look, move
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.marker_nodes import add_node, looks_like
from ros_visualise.ui.scene.solid_batch import Placed, SolidBatch
from ros_visualise.ui.scene.solids import mesh_of, solids_of

_MOST = 5000  # markers of a topic; of more the oldest go
_TRIES = 5  # for the transform at a marker's own stamp, before the newest has to do
_LEVEL = np.array([0.0, 0, 0, 1])
_KINDS = ("cube", "sphere", "cylinder", "cone")


@dataclass
class _Kept:
    """A marker that is there: until when, where, and its node if it is not made of solids."""

    marker: Marker
    until_ns: float
    tries: int = 0
    T_fixed_frame: Floats | None = None
    node: viser.FrameHandle | None = None

    @property
    def follows(self) -> bool:
        """Whether it moves with its frame."""
        return self.marker.frame_locked or not self.marker.header.stamp_ns


class Markers(Drawing):
    """The markers of a topic, of a `Marker` or a `MarkerArray` at a time."""

    stays = True
    gathers: ClassVar[bool] = True

    def __init__(self, scene: viser.SceneApi, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._kept: dict[tuple[str, int], _Kept] = {}
        self._batches = {
            kind: SolidBatch(scene, f"{name}/{kind}", *mesh_of(kind)) for kind in _KINDS
        }
        self._count = 0
        self._fixed = ""
        self._changed = False
        self._places: npt.NDArray[np.floating] = np.zeros((0, 3))
        self._problems: dict[tuple[str, int], str] = {}

    def gather(self, message: Any, now_ns: int) -> None:
        """Do what a message says; what is drawn changes with the next `update`."""
        for marker in message.markers if isinstance(message, MarkerArray) else (message,):
            self._changed = True
            if marker.action == MarkerAction.DELETEALL:
                self._clear(marker.ns)
                continue
            if marker.action == MarkerAction.ADD:
                self._add(marker, now_ns)
            else:
                self._remove((marker.ns, marker.id))
        while len(self._kept) > _MOST:
            self._remove(next(iter(self._kept)))

    def draw(self, message: Any, look: Look) -> None:
        """Nothing: a message is gathered as soon as it comes."""

    def frame_of(self, message: Any, frames: Frames) -> str:
        """The fixed one: each marker has a frame of its own."""
        return ""

    def update(self, frames: Frames, now_ns: int) -> str:
        """Let markers end and move; why some are not drawn."""
        for key in [key for key, one in self._kept.items() if one.until_ns <= now_ns]:
            self._remove(key)
        if frames.fixed != self._fixed:
            self._fixed = frames.fixed
            for one in self._kept.values():
                one.tries, one.T_fixed_frame = 0, None
        for key, one in self._kept.items():
            self._place(key, one, frames)
        if self._changed:
            self._changed = False
            self._show()
        return next(iter(self._problems.values()), "")

    @property
    def texts(self) -> set[str]:
        """The names that can be read there."""
        markers = (one.marker for one in self._kept.values())
        return {one.text for one in markers if one.type == MarkerType.TEXT_VIEW_FACING}

    def extent(self) -> npt.NDArray[np.floating]:
        return self._places

    def reset(self) -> None:
        self._clear("")

    def _place(self, key: tuple[str, int], one: _Kept, frames: Frames) -> None:
        """Find out where a marker's frame is, unless that is known for good."""
        before = one.T_fixed_frame
        if before is not None and one.tries >= _TRIES and not one.follows:
            return
        try:
            found = _locate(one, frames)
        except NoTransform as error:
            self._problems[key] = str(error)
            return
        if before is None:
            self._problems.pop(key, None)
        if before is None or not np.array_equal(before, found):
            one.T_fixed_frame, self._changed = found, True

    def _show(self) -> None:
        """Draw all markers whose place is known."""
        parts: dict[str, list[Placed]] = {kind: [] for kind in _KINDS}
        places = []
        for key, one in self._kept.items():
            if one.T_fixed_frame is None:
                continue
            try:
                T_fixed_marker = one.T_fixed_frame @ pose_of(one.marker)
                for kind, T, scales, rgba in solids_of(one.marker):
                    parts[kind].append((T_fixed_marker @ T, scales, rgba))
                self._show_node(one, T_fixed_marker)
            except ValueError as error:
                self._problems[key] = f"marker {one.marker.ns}/{one.marker.id}: {error}"
                continue
            places.append(transforms.apply(T_fixed_marker, _outline(one.marker)))
        for kind, batch in self._batches.items():
            batch.show(parts[kind])
        self._places = np.concatenate([np.zeros((0, 3)), *places])

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
        added, before = _Kept(marker, until_ns), self._kept.get(key)
        if before is not None and looks_like(before.marker, marker):
            added.node, before.node = before.node, None
        self._remove(key)
        self._kept[key] = added

    def _remove(self, key: tuple[str, int]) -> None:
        one = self._kept.pop(key, None)
        self._problems.pop(key, None)
        if one is not None:
            self._changed = True
            if one.node is not None:
                one.node.remove()

    def _clear(self, ns: str) -> None:
        """Delete all markers of a namespace; without a name, of all."""
        for key in [key for key in self._kept if ns in ("", key[0])]:
            self._remove(key)


def _locate(one: _Kept, frames: Frames) -> Floats:
    """T_fixed_frame of its frame: now, or at its stamp, or now where that cannot be said."""
    stamp_ns = 0 if one.follows else one.marker.header.stamp_ns
    one.tries += 1
    try:
        found = frames.locate(one.marker.header.frame_id, stamp_ns, patient=True)
        one.tries = _TRIES
    except NoTransform:
        found = frames.locate(one.marker.header.frame_id, 0)
    return found


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
