"""Markers that are not solids: lines, points, texts, triangles and meshes, each in its own node."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Marker, MarkerType, Pixels
from ros_visualise.ui.live.space.nodes import Label, Lines, Mesh, Points
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.meshes import add_mesh, load_mesh
from ros_visualise.ui.scene.solids import colors_of

_LOOKS = (
    *("type", "scale_xyz", "color_rgba", "points_xyz", "colors_rgba", "text"),
    *("mesh_resource", "mesh_use_embedded_materials"),
)
_NO_COLOR = np.array([0.6, 0.6, 0.6, 1])
_HAIR_PX = 1.0  # of a line whose width is 0


def add_node(scene: SpaceTree, name: str, marker: Marker) -> None:
    """Draw a marker that is not made of solids, in its own frame.

    Raises:
        ValueError: it cannot be drawn.
    """
    if marker.type not in set(MarkerType):
        raise ValueError(f"unknown type {marker.type}")
    draw = _DRAWN.get(MarkerType(marker.type))
    if draw is not None:
        draw(scene, name, marker)


def looks_like(one: Marker, other: Marker) -> bool:
    """True if two markers differ at most in their poses."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in _LOOKS)


def segments_of(marker: Marker) -> tuple[Floats, Pixels]:
    """Start and end of the lines of a marker, (N, 2, 3), and their colours (N, 2, 3)."""
    count = len(marker.points_xyz)
    colors = _rgb(colors_of(marker, count))
    if marker.type == MarkerType.LINE_STRIP:
        ends = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    else:
        ends = np.arange(count - count % 2).reshape(-1, 2)
    ends = ends.reshape(-1, 2).astype(np.intp)
    return marker.points_xyz[ends], colors[ends]


def _add_lines(scene: SpaceTree, name: str, marker: Marker) -> None:
    points, colors = segments_of(marker)
    if not len(points):
        return
    width = float(marker.scale_xyz[0])
    is_wide = width > 0
    lines = Lines(points=points.astype(np.float32), colors=colors, in_metres=is_wide)
    lines.width = width if is_wide else _HAIR_PX
    scene.add(name, lines)


def _add_points(scene: SpaceTree, name: str, marker: Marker) -> None:
    if len(marker.points_xyz):
        points = Points(points=marker.points_xyz.astype(np.float32), square=True)
        points.colors = _rgb(colors_of(marker, len(marker.points_xyz)))
        points.size = float(marker.scale_xyz[0])
        scene.add(name, points)


def _add_text(scene: SpaceTree, name: str, marker: Marker) -> None:
    """A capital letter is as high as the third scale."""
    height = float(marker.scale_xyz[2])
    if marker.text and height > 0:
        red, green, blue = _rgb(marker.color_rgba[None])[0].tolist()
        color = (red, green, blue) if marker.color_rgba.any() else None
        scene.add(name, Label(text=marker.text, height=height, centred=True, color=color))


def _add_triangles(scene: SpaceTree, name: str, marker: Marker) -> None:
    """Coloured by corner or by triangle, by how many colours there are."""
    count = len(marker.points_xyz) // 3
    if not count:
        raise ValueError("has fewer than three points")
    if len(marker.colors_rgba) == count:
        rgba = marker.colors_rgba.repeat(3, axis=0)
    else:
        rgba = colors_of(marker, len(marker.points_xyz))[: 3 * count]
    vertices = (marker.points_xyz[: 3 * count] * marker.scale_xyz).astype(np.float32)
    faces = np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)
    scene.add(name, Mesh(vertices=vertices, faces=faces, colors=_bytes(rgba)))


def _add_mesh(scene: SpaceTree, name: str, marker: Marker) -> None:
    """A file, in its colours or the marker's; as rviz has it, one of black and clear is gray."""
    rgba = marker.color_rgba if marker.color_rgba.any() else _NO_COLOR
    parts, own_colors = load_mesh(marker.mesh_resource), marker.mesh_use_embedded_materials
    add_mesh(scene, name, parts, marker.scale_xyz, rgba, own_colors)


def _rgb(rgba: npt.NDArray[np.floating]) -> Pixels:
    return _bytes(rgba)[:, :3]


def _bytes(rgba: npt.NDArray[np.floating]) -> Pixels:
    found: Pixels = np.round(np.nan_to_num(np.clip(rgba, 0, 1)) * 255).astype(np.uint8)
    return found


_DRAWN: dict[MarkerType, Callable[[SpaceTree, str, Marker], None]] = {
    MarkerType.LINE_STRIP: _add_lines,
    MarkerType.LINE_LIST: _add_lines,
    MarkerType.POINTS: _add_points,
    MarkerType.TEXT_VIEW_FACING: _add_text,
    MarkerType.TRIANGLE_LIST: _add_triangles,
    MarkerType.MESH_RESOURCE: _add_mesh,
}
