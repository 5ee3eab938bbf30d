"""Robot models in URDF: the shapes of the links, and the joints between them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote, urlsplit
from xml.etree import ElementTree as Xml

import numpy as np

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import read_text
from ros_visualise.data import Floats
from ros_visualise.geometry import rotations, se3
from ros_visualise.ui.scene.meshes import parse_xml

_GRAY = (0.6, 0.6, 0.6, 1.0)
_LONGEST, _MOST_SHAPES = 4 << 20, 1000
_XACRO = "{http://www.ros.org/wiki/xacro}"
_SIZES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1}}
"""Shape -> its attributes, and how many numbers each has."""


@dataclass(frozen=True)
class Shape:
    """A box (its lengths), a cylinder (radius, length), a sphere (radius), or a mesh (its scales).

    Lengths are in metres; ``T_link_shape`` is 4x4; ``rgba`` from 0 to 1; ``mesh`` is its address.
    """

    link: str
    kind: str
    size: tuple[float, ...]
    T_link_shape: Floats
    rgba: tuple[float, ...]
    mesh: str = ""


class Joint(NamedTuple):
    """A joint between two links; ``axis`` is zero where it does not move.

    Its position is that of the joint ``moves_with``, times ``ratio``, plus ``offset``.
    """

    parent: str
    T_parent_joint: Floats
    axis: Floats
    slides: bool
    moves_with: str
    ratio: float = 1.0
    offset: float = 0.0

    def child_pose(self, positions: Mapping[str, float]) -> Floats:
        """T_parent_child, 4x4, at positions of joints in radians or metres; a missing one is 0."""
        position = self.ratio * positions.get(self.moves_with, 0.0) + self.offset
        if self.slides:
            return self.T_parent_joint @ se3.from_parts(np.eye(3), position * self.axis)
        quat_xyzw = np.append(np.sin(position / 2) * self.axis, np.cos(position / 2))
        return self.T_parent_joint @ se3.from_pose(np.zeros(3), quat_xyzw)


class RobotModel(NamedTuple):
    """A robot: its links, parents first, its shapes, and the joint above each child."""

    links: tuple[str, ...]
    shapes: tuple[Shape, ...]
    joints: Mapping[str, Joint]


def read_model(text: str) -> RobotModel:
    """The robot that a URDF describes.

    Raises:
        ValueError: it is not a URDF, or is too large.
    """
    if len(text) > _LONGEST:
        raise ValueError(f"the robot description is larger than {_LONGEST >> 20} MiB")
    try:
        robot = parse_xml(text)
        if any(str(one.tag).startswith(_XACRO) for one in robot.iter()):
            raise ValueError("unexpanded xacro; run: xacro FILE > robot.urdf")
        named = [one for one in robot.iter("material") if one.get("name") and _has_color(one)]
        colors = {one.attrib["name"]: _rgba(one) for one in named}
        joints = dict(_joints(robot))
        names = [link.attrib["name"] for link in robot.iter("link")]
        shapes = tuple(_shapes(robot, colors))
    except (Xml.ParseError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"the robot description is not a valid URDF: {error}") from error
    if len(shapes) > _MOST_SHAPES:
        raise ValueError(f"the robot description has more than {_MOST_SHAPES} shapes")
    return RobotModel(_ordered(names, joints), shapes, joints)


def read_urdf(path: Path) -> str:
    """The URDF in a file; its meshes are named by the places where they are found.

    Packages are looked up among the folders above the file, and beside these.

    Raises:
        OpenError: it cannot be read, or is not a URDF.
    """
    try:
        text = read_text(path)
        read_model(text)
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}; give a URDF file") from None
    except ValueError as error:
        raise OpenError(f"{path}: {error}") from None
    robot = parse_xml(text)
    for mesh in robot.iter("mesh"):
        mesh.set("filename", _resolved(mesh.get("filename", ""), path.resolve().parent))
    return Xml.tostring(robot, encoding="unicode")


def _resolved(address: str, folder: Path) -> str:
    parts = urlsplit(address)
    if not parts.scheme:
        return (folder / address).as_uri()
    if parts.scheme == "package":
        for above in (folder, *folder.parents):
            package = above if above.name == parts.netloc else above / parts.netloc
            path = (package / unquote(parts.path).lstrip("/")).resolve()
            if path.is_file() and path.is_relative_to(package):
                return path.as_uri()
    return address


def _ordered(names: list[str], joints: Mapping[str, Joint]) -> tuple[str, ...]:
    """Links with parents before their children; those whose joints form a circle come last."""
    children: dict[str, list[str]] = {}
    for child, joint in joints.items():
        children.setdefault(joint.parent, []).append(child)
    ordered = [name for name in names if name not in joints]
    for name in ordered:  # which grows
        ordered += children.pop(name, [])
    return tuple(dict.fromkeys([*ordered, *names]))


def _joints(robot: Xml.Element) -> Iterator[tuple[str, Joint]]:
    for joint in robot.iterfind("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is None or child is None:
            raise ValueError(f"joint {joint.get('name')}: needs a parent and a child")
        axis, kind = joint.find("axis"), joint.get("type", "fixed")
        direction = np.array([1.0, 0, 0] if axis is None else _numbers(axis, "xyz", 3, "axis"))
        length = float(np.linalg.norm(direction))
        if kind not in ("revolute", "continuous", "prismatic") or not length:
            direction, length = np.zeros(3), 1.0
        mimic = joint.find("mimic")
        yield (
            child.attrib["link"],
            Joint(
                parent.attrib["link"],
                _origin(joint.find("origin")),
                direction / length,
                kind == "prismatic",
                joint.attrib["name"] if mimic is None else mimic.attrib["joint"],
                1.0 if mimic is None else _number(mimic, "multiplier", 1.0),
                0.0 if mimic is None else _number(mimic, "offset", 0.0),
            ),
        )


def _shapes(robot: Xml.Element, colors: Mapping[str, tuple[float, ...]]) -> Iterator[Shape]:
    for link in robot.iter("link"):
        for visual in link.iter("visual"):
            shape = next(iter(visual.find("geometry") or ()), None)
            if shape is None or shape.tag not in (*_SIZES, "mesh"):
                continue
            size = _size(shape, link.attrib["name"])
            color = _color(visual.find("material"), colors)
            T, mesh = _origin(visual.find("origin")), shape.get("filename", "")
            yield Shape(link.attrib["name"], shape.tag, size, T, color, mesh)


def _size(shape: Xml.Element, link: str) -> tuple[float, ...]:
    where = f"link {link}, {shape.tag}"
    if shape.tag == "mesh":
        return tuple(_numbers(shape, "scale", 3, where)) if "scale" in shape.attrib else (1.0,) * 3
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


def _number(element: Xml.Element, key: str, default: float) -> float:
    return _numbers(element, key, 1, element.tag)[0] if key in element.attrib else default


def _color(
    material: Xml.Element | None, named: Mapping[str, tuple[float, ...]]
) -> tuple[float, ...]:
    """The material's own colour, which need not have a name, or that of the one it names."""
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
    return se3.from_pose(np.array(xyz), rotations.from_rpy(np.array(rpy)))


def _has_color(material: Xml.Element) -> bool:
    return material.find("color") is not None


def _rgba(material: Xml.Element) -> tuple[float, ...]:
    color = material.find("color")
    assert color is not None
    return tuple(_numbers(color, "rgba", 4, "color"))
