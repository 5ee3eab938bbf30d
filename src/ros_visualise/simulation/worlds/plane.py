"""An empty plane."""

from __future__ import annotations

from ros_visualise.simulation.mjcf import WorldBuilder
from ros_visualise.simulation.textures import draw_grid, draw_sky
from ros_visualise.simulation.worlds import World

_HALF_M = 150.0


def build_plane(scene: WorldBuilder) -> None:
    """Add a ground with squares of one metre."""
    scene.add_sky(lambda: draw_sky(256))
    scene.add_ground(_HALF_M, scene.add_material("grid", draw_grid, repeat=0.5))


WORLD = World(build_plane)
