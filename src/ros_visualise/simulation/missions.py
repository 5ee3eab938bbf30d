"""Missions: a shape or waypoints to follow, possibly from a short YAML file."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError, did_you_mean
from ros_visualise.core.yaml_files import open_yaml
from ros_visualise.simulation.attitude import Vector
from ros_visualise.simulation.route import Route
from ros_visualise.simulation.worlds import World

PAD = "pad"
SHAPES = ("square", "figure_of_eight", "lawn_mower")
_EIGHT_POINTS = 120
_FAR_M = 10_000
_LIMITS = {
    "size": (0.1, 1000, "m"),
    "center": (-_FAR_M, _FAR_M, "m"),
    "spacing": (0.1, 1000, "m"),
    "height": (0.3, 1000, "m"),
    "speed": (0.01, 100, "m/s"),
    "laps": (0, 1_000_000, "(0: endless)"),
}
_POINT = "a waypoint is [x, y, z] or [x, y, z, yaw] in metres and degrees"
_FORMS = {
    "shape": f"one of {', '.join(SHAPES)}",
    "size": "one or two numbers, in metres",
    "center": "x and y in metres",
    "laps": "a whole number",
    "waypoints": "a list of [x, y, z] or [x, y, z, yaw], metres and degrees",
    "closed": "true or false",
    "land": "true or false",
    "land_on": f"{PAD}, or omit it",
}
"""Key -> description of its value; the others are numbers."""


@dataclass(frozen=True)
class Mission:
    """A shape or waypoints to follow, and how.

    Attributes:
        shape: one of `SHAPES`, or empty with waypoints.
        size, center: of the shape along x and y, metres.
        spacing: between the rows of a lawn mower, metres.
        height: of a shape, and of waypoints on the ground, for flying robots; metres.
        speed: m/s, up to the robot's limit.
        laps: number of laps on a closed route; 0: endless.
        waypoints: [x, y, z] or [x, y, z, yaw] in ``map``, metres and degrees.
        closed: the last waypoint leads back to the first.
        land: a flying robot returns to its take-off point, and lands there.
        land_on: ``pad``: land on the pad instead, as soon as it is visible; the route searches for
            it, and may be omitted if it is right over the start.

    Raises:
        OpenError: unknown shape, nothing to follow, or an invalid value.
    """

    shape: str = ""
    size: tuple[float, float] = (8.0, 8.0)
    center: tuple[float, float] = (0.0, 0.0)
    spacing: float = 2.5
    height: float = 4.0
    speed: float = 1.0
    laps: int = 1
    waypoints: tuple[tuple[float, ...], ...] = ()
    closed: bool = False
    land: bool = True
    land_on: str = ""

    def __post_init__(self) -> None:
        if self.shape and self.waypoints:
            raise OpenError("a mission has a shape or waypoints, not both; omit one")
        if self.land_on not in ("", PAD):
            raise OpenError(f"land_on cannot be {self.land_on!r}: give {_FORMS['land_on']}")
        if not (self.has_route or self.land_on):
            raise OpenError(f"nothing to follow: give a shape ({', '.join(SHAPES)}) or waypoints")
        if self.shape and self.shape not in SHAPES:
            raise OpenError(f"no such shape: {self.shape!r}{did_you_mean(self.shape, SHAPES)}")
        for name, (low, high, unit) in _LIMITS.items():
            value = getattr(self, name)
            if not all(low <= v <= high for v in (value if isinstance(value, tuple) else [value])):
                raise OpenError(f"{name} is {value}: give a value from {low} to {high} {unit}")
        for point in self.waypoints:
            if len(point) not in (3, 4):
                raise OpenError(f"{_POINT}, not {reprlib.repr(list(point))}")
            if not (max(map(abs, point)) <= _FAR_M and point[2] >= 0):
                where = f"within {_FAR_M} m of the map's origin and not below the ground"
                raise OpenError(f"waypoint {list(point)} must be {where}")

    @property
    def has_route(self) -> bool:
        """True if there is a route, not only a place to land."""
        return bool(self.shape or self.waypoints)

    def route(self) -> Route:
        """The route in ``map``."""
        if self.waypoints:
            points = [(p[0], p[1], p[2] or self.height) for p in self.waypoints]
            yaws = [math.radians(p[3]) if len(p) == 4 else None for p in self.waypoints]
            return Route(points, self.closed, yaws)
        draw = {"square": _square, "figure_of_eight": _eight, "lawn_mower": self._mow}
        (cx, cy), z = self.center, self.height
        points = [(cx + x, cy + y, z) for x, y in draw[self.shape](*self.size)]
        return Route(points, closed=self.shape != "lawn_mower")

    def _mow(self, width: float, depth: float) -> list[tuple[float, float]]:
        rows = max(2, math.ceil(depth / self.spacing) + 1)
        ways = []
        for row in range(rows):
            y = -depth / 2 + depth * row / (rows - 1)
            ends = (-width / 2, width / 2) if row % 2 == 0 else (width / 2, -width / 2)
            ways += [(x, y) for x in ends]
        return ways


def _square(width: float, depth: float) -> list[tuple[float, float]]:
    x, y = width / 2, depth / 2
    return [(-x, -y), (x, -y), (x, y), (-x, y)]


def _eight(width: float, depth: float) -> list[tuple[float, float]]:
    """The lemniscate of Gerono."""
    turns = [2 * math.pi * i / _EIGHT_POINTS for i in range(_EIGHT_POINTS)]
    return [(width / 2 * math.sin(t), depth / 2 * math.sin(2 * t)) for t in turns]


def read_mission(path: str | Path, world: World | None = None) -> Mission:
    """Read a mission from a YAML file whose keys are the fields of `Mission`.

    Args:
        world: gives the default centre and size of a shape.

    Raises:
        OpenError: the file is missing or holds no mission.
    """
    content = open_yaml(path, f"give a YAML file or one of {', '.join(SHAPES)}")
    if not isinstance(content, dict):
        raise OpenError(f"{path}: give a mission as keys and values, such as shape: square")
    known = [field.name for field in fields(Mission)]
    for name in content:
        if name not in known:
            raise OpenError(f"{path}: no such key: {name!r}; choose from {', '.join(known)}")
    try:
        said = {name: _read(name, value) for name, value in content.items()}
        shape = said.get("shape")
        clear = world.clear_area(shape)._asdict() if world and shape else {}
        return Mission(**(clear | said))
    except OpenError as error:
        raise OpenError(f"{path}: {error}") from None


def _read(name: str, value: Any) -> Any:
    """A value from the file, converted to the type of its field."""
    try:
        if name == "waypoints":
            return tuple(_numbers(point) for point in value)
        if name in ("size", "center"):
            pair = _numbers(value if isinstance(value, Sequence) else (value, value))
            if len(pair) != 2:
                raise ValueError
            return pair
        if name in ("closed", "land"):
            return _of_type(value, bool)
        if name in ("shape", "land_on"):
            return _of_type(value, str)
        return _of_type(value, int) if name == "laps" else _number(value)
    except (TypeError, ValueError, OverflowError):
        form = _FORMS.get(name, "a number")
        raise OpenError(f"{name} cannot be {reprlib.repr(value)}: give {form}") from None


def _of_type(value: Any, kind: type) -> Any:
    if type(value) is not kind:
        raise ValueError
    return value


def _number(value: Any) -> float:
    number = float(value)
    if isinstance(value, (str, bool)) or not math.isfinite(number):
        raise ValueError
    return number


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(_number(value) for value in values)


def follow_path(path_xy: Sequence[tuple[float, float]], speed: float) -> Mission:
    """Endless laps on a closed path on the ground."""
    points: list[Vector] = [(x, y, 0.0) for x, y in path_xy]
    return Mission(waypoints=tuple(points), closed=True, speed=speed, laps=0, height=1.0)
