"""A world: a bare hall with a tag at its end."""

import math
from pathlib import Path

from ros_visualise.simulation.landmarks import facing
from ros_visualise.simulation.mjcf import WorldBuilder
from ros_visualise.simulation.worlds import World


def build_hall(scene: WorldBuilder) -> None:
    """Add a floor, four walls, and a board with tag 7 that the rover sees from its start."""
    scene.add_ground(20.0, "0.6 0.58 0.55")
    for side in (-8.0, 8.0):
        scene.add("box", (8.0, 0.1, 1.5), (0.0, side, 1.5), "0.8 0.78 0.7")
        scene.add("box", (0.1, 8.0, 1.5), (side, 0.0, 1.5), "0.8 0.78 0.7")
    scene.add_board(7, (7.8, 0.0, 0.8), facing(math.pi), 0.8)
    scene.starts["husky"] = (3.0, 0.0, 0.0)
    scene.path_xy += [(5.0, -4.0), (5.0, 4.0), (-5.0, 4.0), (-5.0, -4.0)]


WORLD = World(build_hall, tags=Path(__file__).with_name("hall_tags.yaml"))
