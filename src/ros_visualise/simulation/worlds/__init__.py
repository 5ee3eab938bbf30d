"""Simulated worlds, written as MJCF by the program.

The frame is ``map``: x east, y north, z up; the ground is the plane z = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from ros_visualise.errors import OpenError
from ros_visualise.near import near
from ros_visualise.simulation.landmarks import Landmark
from ros_visualise.simulation.worlds.field import build_field
from ros_visualise.simulation.worlds.mjcf import WorldBuilder
from ros_visualise.simulation.worlds.pad import add_pad
from ros_visualise.simulation.worlds.plane import build_plane
from ros_visualise.simulation.worlds.playpen import build_playpen

Pose2 = tuple[float, float, float]
"""x and y in metres, yaw in radians."""


@dataclass(frozen=True)
class World:
    """One world; ``starts`` has the start of each robot, ``path_xy`` is a closed path.

    ``landmarks`` are those that never move, so a landing pad is none.
    """

    name: str
    mjcf: str
    assets: dict[str, bytes]
    landmarks: tuple[Landmark, ...]
    starts: dict[str, Pose2]
    path_xy: tuple[tuple[float, float], ...]

    def landmark(self, name: str) -> Landmark | None:
        """The landmark of that name, or None."""
        return next((each for each in self.landmarks if each.name == name), None)


_BUILDERS = {"plane": build_plane, "playpen": build_playpen, "field": build_field}
WORLDS = tuple(_BUILDERS)


def check_world(name: str) -> str:
    """The name of a world, as it is.

    Raises:
        OpenError: there is no such world.
    """
    if name not in _BUILDERS:
        raise OpenError(f"no world {name!r}{near(name, WORLDS)}")
    return name


@cache
def build_world(
    name: str, pictures: bool = True, pad: Pose2 | None = None, pad_tags: bool = True
) -> World:
    """The world of that name; without pictures it is gray, and ready much sooner.

    Args:
        name: one of `WORLDS`.
        pictures: draw the textures.
        pad: where a landing pad is at first, from the quadrotor's start; None: there is none.
        pad_tags: it has tags.

    Raises:
        OpenError: there is no such world.
    """
    check_world(name)
    scene = WorldBuilder(pictures)
    _BUILDERS[name](scene)
    if pad is not None:
        x, y, _ = scene.starts["quadrotor"]
        add_pad(scene, (x + pad[0], y + pad[1], pad[2]), pad_tags)
    return World(
        name,
        scene.mjcf(),
        scene.assets,
        tuple(scene.landmarks),
        dict(scene.starts),
        tuple(scene.path_xy),
    )
