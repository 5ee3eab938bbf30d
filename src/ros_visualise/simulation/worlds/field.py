"""An outdoor field: a meadow with a gravel path, trees and landmarks."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ros_visualise.simulation.landmarks import SimulatedLandmark, facing, lying
from ros_visualise.simulation.missions import SHAPES
from ros_visualise.simulation.mjcf import SHOWN, SUN_SLOPE, WorldBuilder
from ros_visualise.simulation.textures import (
    SUN_DEGREES,
    Shadow,
    draw_field,
    draw_grass,
    draw_helipad,
    draw_leaves,
    draw_sky,
    draw_wood,
)
from ros_visualise.simulation.worlds import ClearArea, World

_SIDE_M = 48.0
_PICTURE_PX = 2048
_AROUND_M = 120.0
HELIPAD_XY = (-6.0, -3.0)
_HELIPAD_M = 3.0
_ROADSIDE_TAGS = 8
_GROUND_TAGS = ((-2.0, 3.5), (3.0, 3.0), (2.0, -3.0), (6.5, 0.5), (-6.0, 2.0), (-1.5, -0.5))
_POSTS = (
    ("red", "0.86 0.1 0.1", (0.5, 5.0)),
    ("yellow", "0.96 0.82 0.1", (5.0, -2.2)),
    ("blue", "0.1 0.25 0.85", (-3.6, 0.8)),
    ("orange", "0.97 0.45 0.05", (7.2, 3.2)),
    ("white", "0.95 0.95 0.95", (0.4, -5.0)),
    ("magenta", "0.82 0.1 0.62", (-7.5, 4.3)),
)


def build_field(scene: WorldBuilder) -> None:
    """Add the ground, everything on it, and the robots' starts."""
    scene.path_xy += [_path(angle) for angle in np.linspace(0, 2 * math.pi, 90, endpoint=False)]
    scene.add_sky(draw_sky)
    shadows = _plant_trees(scene) + _set_landmarks(scene) + _furnish(scene)
    _lay_ground(scene, shadows)
    (x, y), (ahead_x, ahead_y) = scene.path_xy[0], scene.path_xy[2]
    scene.starts["husky"] = (x, y, math.atan2(ahead_y - y, ahead_x - x))
    scene.starts["quadrotor"] = (*HELIPAD_XY, 0.0)


def _path(angle: float, aside: float = 0.0) -> tuple[float, float]:
    """The centre of the path at an angle around the field, or ``aside`` metres outside of it."""
    swing = 1 + 0.10 * math.sin(3 * angle + 0.4) + 0.05 * math.sin(5 * angle)
    x, y = -12.5 * math.cos(angle) * swing, -9.0 * math.sin(angle) * swing
    out = math.hypot(x, y)
    return x * (1 + aside / out), y * (1 + aside / out)


def _lay_ground(scene: WorldBuilder, shadows: list[Shadow]) -> None:
    path = np.array(scene.path_xy)
    half = _SIDE_M / 2
    scene.add_ground(
        half, scene.add_material("meadow", lambda: draw_field(_PICTURE_PX, _SIDE_M, path, shadows))
    )
    grass = scene.add_material("grass", draw_grass, repeat=0.17)
    middle, reach = (half + _AROUND_M) / 2, (_AROUND_M - half) / 2
    for sign in (-1, 1):
        scene.add("plane", (_AROUND_M, reach, 1), (0, sign * middle, 0), grass, SHOWN)
        scene.add("plane", (reach, half, 1), (sign * middle, 0, 0), grass, SHOWN)


def _plant_trees(scene: WorldBuilder) -> list[Shadow]:
    random = np.random.default_rng(21)
    shadows = []
    leaves = scene.add_material("leaves", draw_leaves, kind="cube")
    for number in range(16):
        angle = 2 * math.pi * (number + random.uniform(-0.3, 0.3)) / 16
        x, y = _path(angle, random.uniform(4.0, 9.0))
        tall = random.uniform(3.2, 5.2)
        wide = tall * random.uniform(0.24, 0.32)
        scene.add("cylinder", (0.05 * tall, tall / 4), (x, y, tall / 4), "0.36 0.26 0.18")
        crown = (wide, wide * random.uniform(0.85, 1.1), tall * 0.36)
        scene.add("ellipsoid", crown, (x, y, tall * 0.66), leaves)
        shadows += [
            _cast(x, y, tall * 0.66, tall * 0.36, wide),
            _cast(x, y, tall / 4, tall / 4, 0.06 * tall),
        ]
        lobe, turn = 0.62 * wide, random.uniform(0, 2 * math.pi)
        dx, dy = 0.7 * wide * math.cos(turn), 0.7 * wide * math.sin(turn)
        scene.add("sphere", (lobe,), (x + dx, y + dy, tall * 0.52), leaves)
    for _ in range(8):
        x, y = _path(random.uniform(0, 2 * math.pi), random.uniform(2.6, 4.0))
        size = random.uniform(0.3, 0.6)
        scene.add("ellipsoid", (size, size * 1.2, size * 0.8), (x, y, size * 0.6), leaves)
        shadows.append(_cast(x, y, size * 0.6, size * 0.8, size))
    return shadows


def _set_landmarks(scene: WorldBuilder) -> list[Shadow]:
    shadows = []
    for number in range(_ROADSIDE_TAGS):
        angle = 2 * math.pi * (number + 0.6) / _ROADSIDE_TAGS
        x, y = _path(angle, 1.7)
        from_x, from_y = _path(angle - 0.35)
        yaw = math.atan2(from_y - y, from_x - x)
        stake = (x - 0.05 * math.cos(yaw), y - 0.05 * math.sin(yaw), 0.5)
        scene.add("box", (0.03, 0.03, 0.5), stake, "0.42 0.3 0.18", yaw=yaw)
        scene.add_board(number, (x, y, 0.75), facing(yaw), 0.48)
        shadows.append(_cast(x, y, 0.75, 0.3, 0.2))
    for number, (x, y) in enumerate(_GROUND_TAGS):
        scene.add_board(10 + number, (x, y, 0.03), lying(0.4 * number), 0.8)
    for colour, rgb, (x, y) in _POSTS:
        scene.add("cylinder", (0.09, 0.7), (x, y, 0.7), rgb)
        shadows.append(_cast(x, y, 0.7, 0.7, 0.09))
        upright = np.eye(3)
        scene.landmarks.append(
            SimulatedLandmark(f"post_{colour}", "post", (x, y, 0.7), upright, 1.4, colour=colour)
        )
    _lay_helipad(scene)
    return shadows


def _lay_helipad(scene: WorldBuilder) -> None:
    half, axes = _HELIPAD_M / 2, lying(math.pi / 2)
    material = scene.add_material("helipad", draw_helipad)
    scene.add("box", (half, half, 0.0025), (*HELIPAD_XY, 0.0025), material, SHOWN, axes)
    place = (*HELIPAD_XY, 0.005)
    scene.landmarks.append(SimulatedLandmark("helipad", "helipad", place, axes, _HELIPAD_M))


def _furnish(scene: WorldBuilder) -> list[Shadow]:
    """A shed, a crate, bales and rocks for the lidar, beside the trees."""
    shadows = [_cast(-17.0, 8.5, 1.15, 1.15, 1.5)]
    wood = scene.add_material("wood", draw_wood, kind="cube")
    scene.add("box", (1.6, 1.2, 1.1), (-17.0, 8.5, 1.1), wood, yaw=-0.5)
    scene.add("box", (1.8, 1.4, 0.06), (-17.0, 8.5, 2.26), "0.5 0.2 0.16", yaw=-0.5)
    sideways = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    for x, y in ((13.5, -9.8), (15.2, -9.3), (-4.5, 12.6)):
        scene.add("cylinder", (0.6, 0.6), (x, y, 0.6), "0.82 0.7 0.38", R=sideways)
        shadows.append(_cast(x, y, 0.6, 0.6, 0.7))
    for x, y, size in (
        (-14.9, -3.6, 0.4),
        (3.2, 11.8, 0.5),
        (15.5, 2.0, 0.45),
        (-2.8, -12.0, 0.35),
    ):
        scene.add("ellipsoid", (size, 0.8 * size, 0.6 * size), (x, y, 0.3 * size), "0.5 0.49 0.47")
        shadows.append(_cast(x, y, 0.3 * size, 0.5 * size, 0.9 * size))
    return shadows


def _cast(x: float, y: float, middle: float, up: float, aside: float) -> Shadow:
    """The shadow of an object with its centre at height ``middle`` and half extents ``up`` and
    ``aside``.
    """
    turn, away = math.radians(SUN_DEGREES), SUN_SLOPE * middle
    along = math.hypot(aside, SUN_SLOPE * up)
    return x + away * math.cos(turn), y + away * math.sin(turn), along, aside


WORLD = World(
    build_field,
    Path(__file__).with_name("field_tags.yaml"),
    dict.fromkeys(SHAPES, ClearArea((-8.5, -2.25), (7.0, 5.5))),  # beside the helipad
)
