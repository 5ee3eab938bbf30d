"""The simple shapes in a URDF, to draw a robot."""

from __future__ import annotations

from collections.abc import Iterator
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
        colors = {one.get("name"): _rgba(one) for one in robot.iter("material") if _has_color(one)}
        return list(_shapes(robot, colors))
    except (Xml.ParseError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the robot's description is no URDF: {error}") from error


def _shapes(robot: Xml.Element, colors: dict[str | None, tuple[float, ...]]) -> Iterator[Shape]:
    for link in robot.iter("link"):
        for visual in link.iter("visual"):
            material = visual.find("material")
            name = None if material is None else material.get("name")
            shape = next(iter(visual.find("geometry") or ()), None)
            if shape is None or shape.tag not in _SIZES:
                continue
            size = tuple(float(n) for key in _SIZES[shape.tag] for n in shape.attrib[key].split())
            T = _origin(visual.find("origin"))
            yield Shape(link.attrib["name"], shape.tag, size, T, colors.get(name, _GRAY))


_SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}


def _origin(origin: Xml.Element | None) -> Floats:
    if origin is None:
        return np.eye(4)
    xyz = [float(n) for n in origin.get("xyz", "0 0 0").split()]
    rpy = [float(n) for n in origin.get("rpy", "0 0 0").split()]
    return transforms.from_pose(np.array(xyz), rotations.from_rpy(np.array(rpy)))


def _has_color(material: Xml.Element) -> bool:
    return material.find("color") is not None


def _rgba(material: Xml.Element) -> tuple[float, ...]:
    color = material.find("color")
    assert color is not None
    return tuple(float(n) for n in color.attrib["rgba"].split())
