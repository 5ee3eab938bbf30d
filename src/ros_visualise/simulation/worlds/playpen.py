"""A fenced yard with obstacles, modelled after the playpen of the Husky's simulation in Gazebo."""

from __future__ import annotations

import math
from pathlib import Path

from ros_visualise.simulation.landmarks import facing
from ros_visualise.simulation.mjcf import WorldBuilder
from ros_visualise.simulation.textures import draw_concrete, draw_sky, draw_wood
from ros_visualise.simulation.worlds import ClearArea, World

_HALF_M = 10.0
_BARRIER_M = 2.5
_CRATES = (
    (4.0, 4.6, 0.5, 0.3),
    (5.1, 5.3, 0.35, 0.9),
    (-5.5, -4.6, 0.6, 0.1),
    (6.5, -6.0, 0.5, 0.7),
)
_BARRELS = ((-3.0, 5.5), (-3.7, 5.2), (-3.3, 6.2), (2.0, -7.0), (7.5, 6.8))
_CONES = ((2.6, 0.0), (4.8, 0.0), (-2.6, 0.0), (-4.8, 0.0), (0.5, 4.0), (-8.2, 2.5), (8.2, -2.5))
_PILLARS = ((-7.0, 7.0), (0.0, -4.0), (8.3, 3.2))
_EIGHT = tuple(math.pi / 2 - 2 * math.pi * i / 60 for i in range(60))


def build_playpen(scene: WorldBuilder) -> None:
    """Add barriers around 20 x 20 m, and crates, barrels, cones, pillars and boards with tags."""
    scene.add_sky(lambda: draw_sky(256))
    scene.add_ground(60.0, scene.add_material("concrete", draw_concrete, repeat=0.5))
    wood = scene.add_material("wood", draw_wood, kind="cube")
    _fence(scene)
    for x, y, half, yaw in _CRATES:
        scene.add("box", (half, half, half), (x, y, half), wood, yaw=yaw)
    for number, (x, y) in enumerate(_BARRELS):
        look = ("0.16 0.32 0.62", "0.75 0.5 0.1")[number % 2]
        scene.add("cylinder", (0.29, 0.44), (x, y, 0.44), look)
    for x, y in _CONES:
        _cone(scene, x, y)
    for x, y in _PILLARS:
        scene.add("cylinder", (0.2, 1.25), (x, y, 1.25), "0.72 0.72 0.7")
    for number, angle in enumerate((0.0, 0.5, 1.0, 1.5)):
        x, y = 9.3 * math.cos(angle * math.pi), 9.3 * math.sin(angle * math.pi)
        scene.add_board(number, (x, y, 0.6), facing((angle + 1) * math.pi), 0.6)
    scene.path_xy += [(7 * math.cos(a), 2.2 * math.sin(2 * a)) for a in _EIGHT]


def _fence(scene: WorldBuilder) -> None:
    """Concrete barriers side by side, alternately darker."""
    count = round(2 * _HALF_M / _BARRIER_M)
    for i in range(count):
        along = -_HALF_M + _BARRIER_M * (i + 0.5)
        look = ("0.78 0.77 0.74", "0.66 0.65 0.63")[i % 2]
        for side in (-_HALF_M, _HALF_M):
            scene.add("box", (_BARRIER_M / 2 - 0.01, 0.12, 0.5), (along, side, 0.5), look)
            scene.add("box", (0.12, _BARRIER_M / 2 - 0.01, 0.5), (side, along, 0.5), look)


def _cone(scene: WorldBuilder, x: float, y: float) -> None:
    orange, white = "0.95 0.38 0.08", "0.95 0.95 0.95"
    scene.add("box", (0.17, 0.17, 0.015), (x, y, 0.015), orange)
    for bottom, top, radius, look in (
        (0.03, 0.28, 0.11, orange),
        (0.28, 0.42, 0.08, white),
        (0.42, 0.7, 0.05, orange),
    ):
        scene.add("cylinder", (radius, (top - bottom) / 2), (x, y, (top + bottom) / 2), look)


WORLD = World(
    build_playpen,
    Path(__file__).with_name("playpen_tags.yaml"),
    {
        "square": ClearArea((0.0, 0.0), (13.0, 5.0)),  # around the cones
        "figure_of_eight": ClearArea((0.0, 0.0), (14.0, 4.4)),
        "lawn_mower": ClearArea((0.0, 0.0), (3.0, 5.6)),  # between the cones
    },
)
