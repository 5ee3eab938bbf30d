"""What markers are made of: solids of four kinds, each drawn many times at once."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

from ros_visualise.data import Floats, Marker, MarkerType
from ros_visualise.data.markers import Colors

_SIDES = 24
_SHAFT, _HEAD = 0.77, 0.23  # of an arrow's length, as rviz draws them
_HEAD_WIDTH = 2.0  # in widths of the shaft
_LEAST_M = 1e-6
_SINGLE = {MarkerType.CUBE: "cube", MarkerType.SPHERE: "sphere", MarkerType.CYLINDER: "cylinder"}
_LISTS = {MarkerType.CUBE_LIST: "cube", MarkerType.SPHERE_LIST: "sphere"}
_ARROWS = (MarkerType.ARROW, MarkerType.ARROW_STRIP)


class Solids(NamedTuple):
    """Copies of one solid, of 1 m in each direction, in the frame of their marker.

    ``T`` (N, 4, 4); ``scales`` (N, 3) along the axes of the solid; ``rgba`` (N, 4).
    """

    kind: str
    T: Floats
    scales: Floats
    rgba: Colors


@cache
def mesh_of(kind: str) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
    """Vertices (V, 3) and faces (F, 3) of a solid: its middle is the origin, its axis is z.

    The bottom of a cone is at the origin.
    """
    if kind == "cube":
        mesh = trimesh.creation.box()
    elif kind == "sphere":
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    elif kind == "cylinder":
        mesh = trimesh.creation.cylinder(radius=0.5, height=1.0, sections=_SIDES)
    else:
        mesh = trimesh.creation.cone(radius=0.5, height=1.0, sections=_SIDES)
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)


def solids_of(marker: Marker) -> list[Solids]:
    """What a marker is made of; nothing for lines, points, texts, triangles and meshes."""
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


def _copies(kind: str, positions_xyz: Floats, marker: Marker) -> Solids:
    count = len(positions_xyz)
    T = np.tile(np.eye(4), (count, 1, 1))
    T[:, :3, 3] = positions_xyz
    return Solids(kind, T, np.tile(marker.scale_xyz, (count, 1)), colors_of(marker, count))


def _arrow_of_pose(marker: Marker) -> list[Solids]:
    """Along the x axis: ``scale_xyz`` are its length, width and height."""
    length, width, height = marker.scale_xyz
    middle, neck = np.array([[_SHAFT * length / 2, 0, 0]]), np.array([[_SHAFT * length, 0, 0]])
    along = np.array([[1.0, 0, 0]])
    shaft = np.array([[width, height, _SHAFT * length]])
    head = np.array([[_HEAD_WIDTH * width, _HEAD_WIDTH * height, _HEAD * length]])
    rgba = marker.color_rgba[None]
    return [
        Solids("cylinder", _upright_along(along, middle), shaft, rgba),
        Solids("cone", _upright_along(along, neck), head, rgba),
    ]


def _arrows_of_points(marker: Marker) -> list[Solids]:
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
        Solids(
            "cylinder",
            _upright_along(along, starts + along * shafts[:, None] / 2),
            _scales(width, shafts),
            rgba,
        ),
        Solids(
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
