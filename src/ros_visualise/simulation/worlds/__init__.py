"""Simulated worlds: a module each.

The frame is ``map``: x east, y north, z up; the ground is the plane z = 0. Another package adds a
world by an entry point of the group ``ros_visualise.worlds``; see `ros_visualise.core.registry`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ros_visualise.core.registry import Registry, holding

if TYPE_CHECKING:
    from ros_visualise.simulation.mjcf import WorldBuilder

Pair = tuple[float, float]


class ClearArea(NamedTuple):
    """``center`` and ``size`` along x and y, metres in ``map``."""

    center: Pair
    size: Pair


_OPEN = ClearArea((0.0, 0.0), (8.0, 8.0))
_TAGS_OF_PAD = Path(__file__).parent / "plane_tags.yaml"  # no other tags


@dataclass(frozen=True)
class World:
    """A type of world.

    Attributes:
        build: adds the ground, objects, and the robots' starts.
        tags: file with the sizes of its tags and those of a landing pad, in apriltag_ros's format.
        clear_areas: shape of a mission -> area without obstacles, also on the straight line from
            the robots' starts; by default 8 x 8 m around the origin.
    """

    build: Callable[[WorldBuilder], None]
    tags: Path = _TAGS_OF_PAD
    clear_areas: Mapping[str, ClearArea] = field(default_factory=dict)

    def clear_area(self, shape: str) -> ClearArea:
        """Area for a mission's shape."""
        return self.clear_areas.get(shape, _OPEN)


WORLDS = Registry("worlds", __name__, holding(World, "WORLD"), first=("plane", "playpen", "field"))

OURS = f"{', '.join(WORLDS.builtin[:-1])} or {WORLDS.builtin[-1]}"
"""The worlds of this package, for a help text."""
