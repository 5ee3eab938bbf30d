"""The simple shapes in a URDF, to draw a robot."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations, transforms

_GRAY = (0.6, 0.6, 0.6, 1.0)


@dataclass(frozen=True)
class Shape:
    """A box (its lengths), a cylinder (radius, length) or a sphere (radius), in metres.

    ``T_link_shape`` is 4x4; ``rgba`` from 0 to 1.
    """

    link: str
    kind: str
    size: tuple[float, ...]
    T_link_shape: Floats
    rgba: tuple[float, ...]


def read_shapes(text: str) -> list[Shape]:
    """The visible shapes of all links; meshes are left out.

    Raises:
        ValueError: it is not a URDF.
    """
    try:
        robot = Xml.fromstring(text)
        named = [one for one in robot.iter("material") if one.get("name") and _has_color(one)]
        colors = {one.attrib["name"]: _rgba(one) for one in named}
        return list(_shapes(robot, colors))
    except (Xml.ParseError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the robot's description is no URDF: {error}") from error


def _shapes(robot: Xml.Element, colors: Mapping[str, tuple[float, ...]]) -> Iterator[Shape]:
    for link in robot.iter("link"):
        for visual in link.iter("visual"):
            shape = next(iter(visual.find("geometry") or ()), None)
            if shape is None or shape.tag not in _SIZES:
                continue
            size = _size(shape, link.attrib["name"])
            color = _color(visual.find("material"), colors)
            T = _origin(visual.find("origin"))
            yield Shape(link.attrib["name"], shape.tag, size, T, color)


_SIZES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1}}
"""Shape -> its attributes, and how many numbers each has."""


def _size(shape: Xml.Element, link: str) -> tuple[float, ...]:
    where = f"link {link}, {shape.tag}"
    needed = _SIZES[shape.tag].items()
    return tuple(n for key, count in needed for n in _numbers(shape, key, count, where))


def _numbers(element: Xml.Element, key: str, count: int, where: str) -> list[float]:
    """The numbers in an attribute.

    Raises:
        ValueError: they are not so many.
    """
    text = element.get(key, "")
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        needs = "a number" if count == 1 else f"{count} numbers"
        raise ValueError(f"{where}: {key} must be {needs}, not {text!r}")
    return found


def _color(
    material: Xml.Element | None, named: Mapping[str, tuple[float, ...]]
) -> tuple[float, ...]:
    """That of the material itself, which need not have a name, or of the one that it names."""
    if material is None:
        return _GRAY
    return _rgba(material) if _has_color(material) else named.get(material.get("name", ""), _GRAY)


def _origin(origin: Xml.Element | None) -> Floats:
    if origin is None:
        return np.eye(4)
    xyz, rpy = (
        _numbers(origin, key, 3, "origin") if key in origin.attrib else [0.0] * 3
        for key in ("xyz", "rpy")
    )
    return transforms.from_pose(np.array(xyz), rotations.from_rpy(np.array(rpy)))


def _has_color(material: Xml.Element) -> bool:
    return material.find("color") is not None


def _rgba(material: Xml.Element) -> tuple[float, ...]:
    color = material.find("color")
    assert color is not None
    return tuple(_numbers(color, "rgba", 4, "color"))
