"""Mesh files that markers and robot models name.

A message may come from anybody, so only small files of this machine are read, and of no format that
is drawn by reading further files: textures and materials beside a mesh are ignored.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree as Xml
from zipfile import is_zipfile

import numpy as np
import numpy.typing as npt

from ros_visualise.core.regular_files import read_file
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Mesh
from ros_visualise.ui.live.space.tree import SpaceTree

if TYPE_CHECKING:
    import trimesh

SUFFIXES = (".stl", ".obj", ".dae")
_LARGEST = 32 << 20
_KEPT = 16
_NO_MATERIAL = (153, 153, 153)


class MeshPart(NamedTuple):
    """Triangles of one colour: vertices (V, 3) in metres, faces (F, 3), RGB from 0 to 255.

    A file without colours has one part, whose ``rgb`` is None.
    """

    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    rgb: Color | None


@lru_cache(_KEPT)
def load_mesh(resource: str) -> tuple[MeshPart, ...]:
    """The parts of the mesh at a ``package://`` or ``file://`` address.

    Raises:
        ValueError: it cannot be read; the message says why.
    """
    path = _path_of(resource)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ValueError(f"{resource}: unsupported format; supported: {', '.join(SUFFIXES)}")
    if not path.is_file():
        raise ValueError(f"{resource}: no such file")
    if path.stat().st_size > _LARGEST:
        raise ValueError(f"{resource}: larger than {_LARGEST >> 20} MiB")
    try:
        parts = _read(read_file(path), suffix)
    except Exception as error:  # the library's readers raise what they happen to meet
        raise ValueError(f"{resource}: cannot be read: {error}") from error
    if not parts or not all(np.isfinite(part.vertices).all() for part in parts):
        raise ValueError(f"{resource}: not a mesh")
    return tuple(parts)


def add_mesh(
    scene: SpaceTree,
    name: str,
    parts: tuple[MeshPart, ...],
    scale_xyz: npt.ArrayLike,
    rgba: npt.ArrayLike,
    own_colors: bool,
) -> None:
    """Draw a mesh, in a node of this name and in others below it.

    Args:
        rgba: its colour, 0 to 1, for files without colours.
        own_colors: use those of the file.
    """
    red, green, blue = (round(255 * float(value)) for value in np.clip(rgba, 0, 1)[:3])
    for number, part in enumerate(parts):
        mesh = Mesh(vertices=part.vertices * np.asarray(scale_xyz, np.float32), faces=part.faces)
        mesh.colors = part.rgb if own_colors and part.rgb else (red, green, blue)
        mesh.opacity = float(np.clip(rgba, 0, 1)[3])
        scene.add(f"{name}/{number}" if number else name, mesh)


def parse_xml(data: str | bytes) -> Xml.Element:
    """The root of an XML document, which has to do without entities of its own.

    Raises:
        ValueError: it declares a document type.
        ParseError: it is not XML.
    """
    return Xml.fromstring(data, Xml.XMLParser(target=_Builder()))


class _Builder(Xml.TreeBuilder):
    def doctype(self, *_: object) -> None:
        raise ValueError("XML with a document type is not allowed")


def _read(data: bytes, suffix: str) -> list[MeshPart]:
    import trimesh  # takes as long as a third of the page's start

    scale = 1.0
    if suffix == ".dae":
        unit = parse_xml(data).find("{*}asset/{*}unit")
        scale = 1.0 if unit is None else float(unit.get("meter", 1))
        if not 0 < scale < math.inf or is_zipfile(BytesIO(data)):
            raise ValueError("damaged COLLADA file")
    loaded: Any = trimesh.load(BytesIO(data), file_type=suffix[1:], force="scene")
    meshes: dict[Color | None, list[trimesh.Trimesh]] = {}
    for node in loaded.graph.nodes_geometry:
        T, name = loaded.graph[node]
        mesh = loaded.geometry[name].copy()
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            color = _color(mesh) if suffix == ".dae" else None
            meshes.setdefault(color, []).append(mesh.apply_transform(T))
    return [_part(several, scale, color) for color, several in meshes.items()]


def _part(meshes: list[trimesh.Trimesh], scale: float, rgb: Color | None) -> MeshPart:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    vertices = np.concatenate([mesh.vertices for mesh in meshes]) * scale
    return MeshPart(vertices.astype(np.float32), np.concatenate(faces).astype(np.uint32), rgb)


def _color(mesh: trimesh.Trimesh) -> Color:
    material = getattr(mesh.visual, "material", None)
    if material is None:
        return _NO_MATERIAL
    red, green, blue = map(int, material.main_color[:3])
    return red, green, blue


def _path_of(resource: str) -> Path:
    parts = urlsplit(resource)
    if parts.scheme == "file":
        return Path(unquote(parts.path))
    if parts.scheme != "package":
        raise ValueError(f"{resource!r}: give a mesh as package://PACKAGE/FILE or file:///FILE")
    folder = next((one for one in _folders(parts.netloc) if one.is_dir()), None)
    if folder is None:
        raise ValueError(f"{resource}: package {parts.netloc} not found; set ROS_PACKAGE_PATH")
    path = (folder / unquote(parts.path).lstrip("/")).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise ValueError(f"{resource}: outside its package")
    return path


def _folders(package: str) -> Iterator[Path]:
    """Folders in which a package may be, in ROS 1 and in ROS 2."""
    for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if root:
            yield Path(root) if Path(root).name == package else Path(root, package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix, "share", package)
