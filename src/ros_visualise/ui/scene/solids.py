"""Solids of four kinds that make up markers, each drawn many times in one node."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Marker, MarkerType
from ros_visualise.data.markers import Colors
from ros_visualise.geometry import se3
from ros_visualise.ui.live.space.nodes import Solids
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import to_wxyz

_SHAFT, _HEAD = 0.77, 0.23  # of an arrow's length, as rviz draws them
_HEAD_WIDTH = 2.0  # in widths of the shaft
_LEAST_M = 1e-6
_SINGLE = {MarkerType.CUBE: "cube", MarkerType.SPHERE: "sphere", MarkerType.CYLINDER: "cylinder"}
_LISTS = {MarkerType.CUBE_LIST: "cube", MarkerType.SPHERE_LIST: "sphere"}
_ARROWS = (MarkerType.ARROW, MarkerType.ARROW_STRIP)

Placed = tuple[Floats, Floats, npt.NDArray[np.floating]]
"""T (N, 4, 4), scales (N, 3) and rgba (N, 4) from 0 to 1."""

_Rows = npt.NDArray[np.float32]
_PLACE, _TURN, _SIZE, _RGB, _ALPHA = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13), 13
_COLUMNS = 14


class MarkerSolids(NamedTuple):
    """Copies of one solid, of 1 m in each direction, in the frame of their marker.

    ``T`` (N, 4, 4); ``scales`` (N, 3) along the axes of the solid; ``rgba`` (N, 4).
    """

    kind: str
    T: Floats
    scales: Floats
    rgba: Colors


def solids_of(marker: Marker) -> list[MarkerSolids]:
    """The solids of a marker; empty for lines, points, texts, triangles and meshes."""
    if marker.type in _SINGLE:
        middle = np.zeros((1, 3))
        return [_copies(_SINGLE[MarkerType(marker.type)], middle, marker)]
    if marker.type in _LISTS:
        return [_copies(_LISTS[MarkerType(marker.type)], marker.points_xyz, marker)]
    if marker.type not in _ARROWS:
        return []
    if marker.type == MarkerType.ARROW and not len(marker.points_xyz):
        return _arrow_of_pose(marker)
    return _arrows_of_points(marker)


def colors_of(marker: Marker, count: int) -> Colors:
    """A marker's colours, one for each of so many things: (count, 4)."""
    if len(marker.colors_rgba) == count:
        return marker.colors_rgba
    return np.broadcast_to(marker.color_rgba, (count, 4))


def _copies(kind: str, positions_xyz: Floats, marker: Marker) -> MarkerSolids:
    count = len(positions_xyz)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, 3] = positions_xyz
    return MarkerSolids(kind, T, np.tile(marker.scale_xyz, (count, 1)), colors_of(marker, count))


def _arrow_of_pose(marker: Marker) -> list[MarkerSolids]:
    """Along the x axis: ``scale_xyz`` are its length, width and height."""
    length, width, height = marker.scale_xyz
    middle, neck = np.array([[_SHAFT * length / 2, 0, 0]]), np.array([[_SHAFT * length, 0, 0]])
    along = np.array([[1.0, 0, 0]])
    shaft = np.array([[width, height, _SHAFT * length]])
    head = np.array([[_HEAD_WIDTH * width, _HEAD_WIDTH * height, _HEAD * length]])
    rgba = marker.color_rgba[None]
    return [
        MarkerSolids("cylinder", _upright_along(along, middle), shaft, rgba),
        MarkerSolids("cone", _upright_along(along, neck), head, rgba),
    ]


def _arrows_of_points(marker: Marker) -> list[MarkerSolids]:
    """From each point to the next.

    ``scale_xyz`` are the widths of shaft and head, and the head's length, where it is not 0.
    """
    points = marker.points_xyz if marker.type == MarkerType.ARROW_STRIP else marker.points_xyz[:2]
    ways = np.diff(points, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    there = lengths > _LEAST_M
    starts, along = points[:-1][there], ways[there] / lengths[there, None]
    lengths = lengths[there]
    width, head_width, head = marker.scale_xyz
    heads = np.minimum(head, lengths) if head > 0 else _HEAD * lengths
    shafts = lengths - heads
    rgba = np.broadcast_to(marker.color_rgba, (len(lengths), 4))
    return [
        MarkerSolids(
            "cylinder",
            _upright_along(along, starts + along * shafts[:, None] / 2),
            _scales(width, shafts),
            rgba,
        ),
        MarkerSolids(
            "cone",
            _upright_along(along, starts + along * shafts[:, None]),
            _scales(head_width, heads),
            rgba,
        ),
    ]


def _scales(width: float, lengths: Floats) -> Floats:
    widths = np.full(len(lengths), width)
    return np.column_stack([widths, widths, lengths])


def _upright_along(along: Floats, positions_xyz: Floats) -> Floats:
    """T (N, 4, 4) of frames there whose z axes have these directions (N, 3)."""
    helper = np.where(np.abs(along[:, 2:]) < 0.9, [[0.0, 0, 1]], [[0.0, 1, 0]])
    x = np.cross(helper, along)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    T = np.tile(np.eye(4), (len(along), 1, 1))
    T[:, :3, :3] = np.stack([x, np.cross(along, x), along], axis=2)
    T[:, :3, 3] = positions_xyz
    return T


class SolidBatch:
    """Copies that may each have a size and a colour of their own, some under each of many keys.

    Args:
        scene: where to draw.
        name: of the node.
        shape: cube, sphere, cylinder or cone.
    """

    def __init__(self, scene: SpaceTree, name: str, shape: str) -> None:
        self._scene, self._name, self._solids = scene, name, Solids(shape=shape)
        self._new: dict[Hashable, Placed] = {}
        self._parts: dict[Hashable, _Rows] = {}  # each a view of the rows of all
        self._rows: _Rows = np.zeros((0, _COLUMNS), np.float32)
        self._is_other = False  # how many copies there are under some key

    def put(self, key: Hashable, part: Placed) -> None:
        """Replace the copies under a key, from the next `show` on."""
        self._new[key] = part

    def drop(self, key: Hashable) -> None:
        """Remove the copies under a key, from the next `show` on."""
        self._new.pop(key, None)
        if self._parts.pop(key, None) is not None:
            self._is_other = True

    def show(self) -> None:
        """Draw the copies that can be seen."""
        if not self._new and not self._is_other:
            return
        for key, rows in zip(self._new, _rows_of(list(self._new.values())), strict=True):
            self._set(key, rows)
        self._new.clear()
        if self._is_other:
            self._gather()
        self._solids.rows = self._rows
        if len(self._rows) and self._solids.tree is None:
            self._scene.add(self._name, self._solids)

    def _set(self, key: Hashable, rows: _Rows) -> None:
        there = self._parts.get(key)
        if there is not None and len(there) == len(rows):
            there[:] = rows
        else:
            self._parts[key], self._is_other = rows, True

    def _gather(self) -> None:
        """Line up the rows of all keys."""
        empty = np.zeros((0, _COLUMNS), np.float32)
        self._rows = np.concatenate([empty, *self._parts.values()])
        ends = np.cumsum([len(rows) for rows in self._parts.values()], dtype=int)
        for key, end in zip(self._parts, ends, strict=True):
            self._parts[key] = self._rows[end - len(self._parts[key]) : end]
        self._is_other = False


def _rows_of(parts: Sequence[Placed]) -> list[_Rows]:
    """A row for each copy that can be seen, part by part: all are converted at once."""
    T = np.concatenate([np.zeros((0, 4, 4)), *(part[0] for part in parts)])
    positions, quats_xyzw = se3.to_pose(T)
    rows = np.empty((len(T), _COLUMNS), np.float32)
    rows[:, _PLACE], rows[:, _TURN] = positions, to_wxyz(quats_xyzw)
    rows[:, _SIZE] = np.concatenate([np.zeros((0, 3)), *(part[1] for part in parts)])
    rgba = np.concatenate([np.zeros((0, 4)), *(part[2] for part in parts)])
    rows[:, _RGB.start :] = np.clip(rgba, 0, 1)
    ends = np.cumsum([len(part[0]) for part in parts], dtype=int)[:-1]
    return [one[one[:, _ALPHA] > 0] for one in np.split(rows, ends)] if parts else []
