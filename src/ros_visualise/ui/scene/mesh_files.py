"""Meshes that a message names: STL files of this machine.

A message may come from anybody, so only small files are read, and only STL: files of other formats
name further files.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import numpy.typing as npt
import trimesh

from ros_visualise.core.regular_files import read_file

_LARGEST = 16 << 20
_KEPT = 16

Mesh = tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]
"""Vertices (V, 3) in the file's own unit, and faces (F, 3)."""


@lru_cache(_KEPT)
def load_mesh(resource: str) -> Mesh:
    """The mesh of a ``package://`` or ``file://`` address.

    Raises:
        ValueError: it cannot be read; the message says why.
    """
    path = _path_of(resource)
    if path.suffix.lower() != ".stl":
        raise ValueError(f"{resource}: only meshes in .stl files are read")
    if not path.is_file():
        raise ValueError(f"{resource}: there is no such file")
    if path.stat().st_size > _LARGEST:
        raise ValueError(f"{resource} is larger than {_LARGEST >> 20} MiB")
    try:
        mesh = trimesh.load_mesh(BytesIO(read_file(path)), file_type="stl")
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as error:  # the library's reader raises what it happens to meet
        raise ValueError(f"{resource} cannot be read: {error}") from error
    if not len(faces) or not np.isfinite(vertices).all():
        raise ValueError(f"{resource} holds no mesh")
    return vertices.astype(np.float32), faces.astype(np.uint32)


def _path_of(resource: str) -> Path:
    parts = urlsplit(resource)
    if parts.scheme == "file":
        return Path(unquote(parts.path))
    if parts.scheme != "package":
        raise ValueError(f"{resource!r}: give a mesh as package://PACKAGE/FILE or file:///FILE")
    folder = next((one for one in _folders(parts.netloc) if one.is_dir()), None)
    if folder is None:
        raise ValueError(f"{resource}: package {parts.netloc} is not installed, or not sourced")
    path = (folder / unquote(parts.path).lstrip("/")).resolve()
    if not path.is_relative_to(folder.resolve()):
        raise ValueError(f"{resource} is not in its package")
    return path


def _folders(package: str) -> Iterator[Path]:
    """Where a package may be, in ROS 1 and in ROS 2."""
    for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if root:
            yield Path(root) if Path(root).name == package else Path(root, package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix, "share", package)
