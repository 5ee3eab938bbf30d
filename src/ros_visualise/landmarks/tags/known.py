"""Sizes of printed tags, and bundles of several tags on one body.

The file is apriltag_ros's ``tags.yaml``; lengths are in metres:

    standalone_tags:
      - {id: 3, size: 0.162}
      - {id: 4, size: 0.05, name: dock}
    tag_bundles:
      - name: box
        layout:
          - {id: 10, size: 0.05, x: 0.0, y: 0.0, z: 0.0, qw: 1.0, qx: 0.0, qy: 0.0, qz: 0.0}
          - {id: 11, size: 0.05, x: 0.1}

Two more keys are TagSLAM's: tags that are ignored, and tags that get another id from one time to
another, in seconds, since they were moved or replaced while it was recorded:

    ignore_tags: [166, 213]
    tag_id_remap:
      - id: 20
        remaps:
          - {remap_id: 420, start_time: 1541686885.9, end_time: 1541686936.5}

A tag's pose in its bundle transforms points of the tag's frame (x right, y up, z towards the
viewer) to the bundle's. Ids apply to all families.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.yaml_files import open_yaml
from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose.estimating import SQUARE
from ros_visualise.landmarks.tags.finder import Tag

_POSE = {"x": 0.0, "y": 0.0, "z": 0.0, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}

_LEAST_M, _MOST_M = 1e-4, 100.0  # side of a tag
_FAR_M = 1e4  # largest distance from a bundle's origin


@dataclass(frozen=True, eq=False)
class Bundle:
    """A body with several tags: id -> corners (4, 3) in its frame, ordered as those of a `Tag`."""

    name: str
    corners_xyz: Mapping[int, Floats]


@dataclass(frozen=True)
class RenamedTag:
    """A tag that has another id from one time to another."""

    id: int
    new_id: int
    start_ns: int
    end_ns: int


@dataclass(frozen=True, eq=False)
class KnownTags:
    """Tags by id: the sides of their squares in metres, their names, bundles, and changes."""

    sizes: Mapping[int, float] = field(default_factory=dict)
    names: Mapping[int, str] = field(default_factory=dict)
    bundles: tuple[Bundle, ...] = ()
    ignored: frozenset[int] = frozenset()
    renamed: tuple[RenamedTag, ...] = ()

    @property
    def every(self) -> Collection[int]:
        """The ids of known size."""
        return {*self.sizes, *(id for bundle in self.bundles for id in bundle.corners_xyz)}

    def present(
        self, tags: Sequence[Tag], stamp_ns: int, ignored: Collection[int] = ()
    ) -> tuple[Tag, ...]:
        """The tags of an image with the ids that they have at its time, except ignored ones."""
        now = [replace(tag, id=self._id(tag.id, stamp_ns)) for tag in tags]
        return tuple(tag for tag in now if tag.id not in self.ignored and tag.id not in ignored)

    def _id(self, id: int, stamp_ns: int) -> int:
        for one in self.renamed:
            if one.id == id and one.start_ns <= stamp_ns <= one.end_ns:
                return one.new_id
        return id


def parse_ids(text: str) -> frozenset[int]:
    """Ids separated by commas.

    Raises:
        ParameterError: one is not a number.
    """
    parts = [part.strip() for part in text.split(",") if part.strip()]
    for part in parts:
        if not part.isdecimal():
            raise ParameterError(f"{part!r} is not the id of a tag; give numbers such as 166,213")
    return frozenset(map(int, parts))


def read_known_tags(path: str | Path) -> KnownTags:
    """The tags in a file.

    Raises:
        OpenError: it cannot be read or is invalid; the message says where.
    """
    values = open_yaml(path, "give a YAML file of tags")
    try:
        return _known(values)
    except _Invalid as error:
        raise OpenError(f"{path}: {error}") from None


class _Invalid(ValueError):
    """An error in the file; says where, and what to give instead."""


def _known(values: Any) -> KnownTags:
    keys = ("standalone_tags", "tag_bundles", "ignore_tags", "tag_id_remap")
    parts = _fields("the file", values, (), keys)
    sizes: dict[int, float] = {}
    names: dict[int, str] = {}
    for number, one in enumerate(_listed(parts, "standalone_tags"), 1):
        where = f"standalone_tags, entry {number}"
        tag = _fields(where, one, ("id", "size"), ("name",))
        id = _id(where, tag, sizes)
        sizes[id] = _size(where, tag)
        if "name" in tag:
            names[id] = _name(where, tag)
    bundles = [
        _bundle(f"tag_bundles, entry {number}", one, sizes)
        for number, one in enumerate(_listed(parts, "tag_bundles"), 1)
    ]
    _refuse_shared(bundles)
    every = [*names.values(), *(one.name for one in bundles)]
    for name in every:
        if every.count(name) > 1:
            raise _Invalid(f"duplicate name {name!r}; names must be unique")
    ignored = frozenset(
        _id("ignore_tags", {"id": one}, ()) for one in _listed(parts, "ignore_tags")
    )
    renamed = [
        one
        for number, values in enumerate(_listed(parts, "tag_id_remap"), 1)
        for one in _renamed(f"tag_id_remap, entry {number}", values)
    ]
    return KnownTags(sizes, names, tuple(bundles), ignored, tuple(renamed))


def _renamed(where: str, values: Any) -> list[RenamedTag]:
    tag = _fields(where, values, ("id", "remaps"), ())
    id, found = _id(where, tag, ()), []
    for number, one in enumerate(_listed(tag, "remaps"), 1):
        place = f"{where}, remap {number}"
        change = _fields(place, one, ("remap_id", "start_time", "end_time"), ())
        new_id = _id(place, {"id": change["remap_id"]}, ())
        start, end = (_stamp_ns(place, change, key) for key in ("start_time", "end_time"))
        found.append(RenamedTag(id, new_id, start, end))
    return found


def _stamp_ns(where: str, values: Mapping[str, Any], name: str) -> int:
    try:
        return round(float(values[name]) * 1e9)
    except (TypeError, ValueError, OverflowError):
        raise _Invalid(f"{where}: {name} is {values[name]!r}; give a number of seconds") from None


def _refuse_shared(bundles: Sequence[Bundle]) -> None:
    """Reject tags in two bundles."""
    bearer: dict[int, str] = {}
    for bundle in bundles:
        for id in bundle.corners_xyz:
            if id in bearer:
                raise _Invalid(f"tag {id} is in two bundles, {bearer[id]!r} and {bundle.name!r}")
            bearer[id] = bundle.name


def _bundle(where: str, values: Any, sizes: Mapping[int, float]) -> Bundle:
    bundle = _fields(where, values, ("name", "layout"), ())
    corners: dict[int, Floats] = {}
    for number, one in enumerate(_listed(bundle, "layout"), 1):
        place = f"{where}, layout entry {number}"
        tag = {**_POSE, **_fields(place, one, ("id", "size"), tuple(_POSE))}
        id, size = _id(place, tag, corners), _size(place, tag)
        if sizes.get(id, size) != size:
            raise _Invalid(
                f"{place}: size {size:g}, but {sizes[id]:g} in standalone_tags (tag {id})"
            )
        x, y, z, *quat_wxyz = (_number(place, tag, name) for name in _POSE)
        length = math.hypot(*quat_wxyz)
        if not 0.9 < length < 1.1:
            raise _Invalid(f"{place}: qw, qx, qy, qz have norm {length:g}; give a unit quaternion")
        R = rotations.to_matrix(np.roll(quat_wxyz, -1) / length)
        corners[id] = SQUARE * size @ R.T + [x, y, z]
    if not corners:
        raise _Invalid(f"{where}: no tags in its layout")
    return Bundle(_name(where, bundle), corners)


def _fields(
    where: str, values: Any, needed: Collection[str], allowed: Collection[str]
) -> dict[str, Any]:
    every = (*needed, *allowed)
    if not isinstance(values, dict):
        raise _Invalid(f"{where}: give a mapping with keys from {', '.join(every)}")
    for key in values:
        if key not in every:
            raise _Invalid(f"{where}: unknown key {key!r}; choose from {', '.join(every)}")
    for key in needed:
        if key not in values:
            raise _Invalid(f"{where}: missing {key}")
    return values


def _listed(values: Mapping[str, Any], name: str) -> list[Any]:
    found = values.get(name)
    if found is not None and not isinstance(found, list):
        raise _Invalid(f"{name}: give a list")
    return found or []


def _id(where: str, tag: Mapping[str, Any], taken: Collection[int]) -> int:
    id = tag["id"]
    if isinstance(id, bool) or not isinstance(id, int) or id < 0:
        raise _Invalid(f"{where}: id is {id!r}; give an integer, 0 or more")
    if id in taken:
        raise _Invalid(f"{where}: duplicate tag {id}")
    return id


def _size(where: str, tag: Mapping[str, Any]) -> float:
    size = _number(where, tag, "size")
    if not _LEAST_M <= size <= _MOST_M:
        raise _Invalid(f"{where}: size is {size:g}; give the side of its square in metres")
    return size


def _number(where: str, tag: Mapping[str, Any], name: str) -> float:
    number = tag[name]
    is_number = isinstance(number, int | float) and not isinstance(number, bool)
    if not is_number or not abs(number) <= _FAR_M:
        raise _Invalid(f"{where}: {name} is {number!r}; give a number in metres")
    return float(number)


def _name(where: str, values: Mapping[str, Any]) -> str:
    name = values["name"]
    if not isinstance(name, str) or not name.strip():
        raise _Invalid(f"{where}: name is {name!r}; give a non-empty string")
    return name
