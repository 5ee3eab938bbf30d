"""Appearance of places, in a file beside the map that has their poses.

The map ``field.yaml`` lists places as landmarks, with their poses and covariances, for any
reader of maps. Their features are in ``field.places.npz``, uncompressed arrays of NumPy:

    counts       (P,) int32       features of each place
    descriptors  (N, 32) uint8    of ORB
    rays         (N, 2) float32   directions x/z and y/z in the axes of the view
    inverse      (N,) float32     inverse depths, 1/m

The name of a place is a checksum of its descriptors, so files of different maps are not confused.
"""

from __future__ import annotations

import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.data import Floats
from ros_visualise.estimation.camera_view import PLACE
from ros_visualise.estimation.localization import map_file
from ros_visualise.geometry import se3
from ros_visualise.vision.places import Descriptors

MOST_PLACES = 1500  # with 400 tags, as many as a map may list
_MOST_FEATURES = 600 * MOST_PLACES
_MOST_BYTES = 44 * _MOST_FEATURES + (1 << 16)
_MEMBER, _MOST_MEMBERS = b"PK\x01\x02", 100  # in the directory of the archive
_DAMAGE = (
    *(ValueError, LookupError, TypeError, EOFError, RuntimeError, OverflowError, MemoryError),
    *(SyntaxError, tokenize.TokenError, struct.error, zipfile.BadZipFile),
)  # raised by zipfile, and by NumPy for the header of an array
_LARGEST = 1e6, 10.0  # inverse depth, 1/m, and slope of a ray
_ADVICE = (
    "write it again with landmarks --places or save_places, or copy it from where the map came from"
)


class PlaceLook(NamedTuple):
    """Appearance of a place: its features' descriptors (N, 32), rays (N, 2), inverse depths."""

    descriptors: Descriptors
    rays: Floats
    inverse: Floats

    @property
    def id(self) -> int:
        """Made from what it looks like, so that no two maps confuse their places."""
        return zlib.crc32(self.descriptors.tobytes())

    @property
    def depth(self) -> float:
        """Median depth of its features, metres: how far ahead of its view its origin is."""
        return float(np.median(1 / self.inverse))


class MappedPlace(NamedTuple):
    """A place of a map, and T_map_view (4, 4) of the view that it is."""

    look: PlaceLook
    T_map_view: Floats


def places_path(map_path: Path) -> Path:
    """The file beside a map; for a symbolic link, beside the file that it leads to."""
    path = Path(os.path.realpath(map_path)) if map_path.is_symlink() else map_path
    return path.with_suffix(".places.npz")


def to_bytes(looks: Sequence[PlaceLook]) -> bytes:
    """The file; see the module."""
    stream = BytesIO()
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(one, name) for one in looks]).astype(kind)
        for name, kind in _KINDS.items()
    }
    arrays["counts"] = np.array([len(one.inverse) for one in looks], np.int32)
    np.savez(stream, **arrays)
    return stream.getvalue()


def load_places(map_path: Path) -> list[MappedPlace]:
    """The places of a map; none if it lists none.

    Raises:
        OpenError: the map, or the file beside it, is missing, damaged, too large, or another map's.
    """
    tracks = {one.class_id: one.best for one in map_file.load(map_path).landmarks}
    tracks = {name: pose for name, pose in tracks.items() if name.startswith(PLACE)}
    path = places_path(map_path)
    if not tracks:
        return []
    found = []
    for look in load_looks(path):
        pose = tracks.get(f"{PLACE}{look.id}")
        if pose is not None:
            at = se3.from_parts(pose.R_fixed_landmark, pose.position_xyz)
            found.append(MappedPlace(look, at @ se3.from_parts(np.eye(3), [0, 0, -look.depth])))
    if not found:
        raise OpenError(f"{path}: contains no place of {map_path.name}; {_ADVICE}")
    return found


_KINDS: dict[str, type] = {"descriptors": np.uint8, "rays": np.float32, "inverse": np.float32}
_SHAPES: dict[str, tuple[int, ...]] = {"descriptors": (32,), "rays": (2,), "inverse": ()}


def load_looks(path: Path) -> list[PlaceLook]:
    """The places in a file; raises as `load_places`."""
    try:
        with open_file(path) as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES or data.count(_MEMBER) > _MOST_MEMBERS:
            raise ValueError("too large")
        with zipfile.ZipFile(BytesIO(data)) as archive:
            counts = _array(archive, "counts", np.int32, (), MOST_PLACES)
            total = int(counts.sum(dtype=np.int64))
            if not len(counts) or (counts < 1).any() or total > _MOST_FEATURES:
                raise ValueError("no places, or places with no features or too many")
            arrays = {
                name: _array(archive, name, kind, _SHAPES[name], total)
                for name, kind in _KINDS.items()
            }
    except FileNotFoundError:
        raise OpenError.missing(path, _ADVICE) from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror or error}; {_ADVICE}") from None
    except _DAMAGE as error:
        raise OpenError(f"{path}: not a file of places: {error}; {_ADVICE}") from None
    rays, inverse = arrays["rays"].astype(float), arrays["inverse"].astype(float)
    if any(len(one) != total for one in arrays.values()):
        raise OpenError(f"{path}: damaged: arrays of different lengths; {_ADVICE}")
    if not ((inverse > 0) & (inverse < _LARGEST[0]) & (abs(rays) < _LARGEST[1]).all(1)).all():
        raise OpenError(f"{path}: damaged: invalid depths or rays; {_ADVICE}")
    ends = np.cumsum(counts)[:-1]
    several = zip(*(np.split(one, ends) for one in (arrays["descriptors"], rays, inverse)),
                  strict=True)  # fmt: skip
    return [PlaceLook(*one) for one in several]


def _array(
    archive: zipfile.ZipFile, name: str, kind: type, row: tuple[int, ...], most: int
) -> npt.NDArray[Any]:
    """An array of the archive, if it has at most ``most`` rows, and is stored as it is."""
    info = archive.getinfo(f"{name}.npy")
    each = np.dtype(kind).itemsize * int(np.prod(row, dtype=int))
    if info.file_size > most * each + (1 << 12):
        raise ValueError(f"more than {most} rows of {name}")
    if info.compress_type != zipfile.ZIP_STORED or info.compress_size != info.file_size:
        raise ValueError(f"{name} is compressed")
    stream = BytesIO(archive.read(info))
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"{name} has an unknown format")
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    if dtype != np.dtype(kind) or shape[1:] != row or len(shape) != 1 + len(row) or is_fortran:
        raise ValueError(f"{name} has an unexpected type or shape")
    return np.frombuffer(stream.read(), dtype).reshape(shape)
