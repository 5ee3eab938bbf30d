"""A world in use: dirty and covered tags, copies of tags, and clutter that looks like landmarks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.simulation.landmarks import SimulatedLandmark, lying
from ros_visualise.simulation.mjcf import SHOWN, Canvas, WorldBuilder
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.sensors import setting
from ros_visualise.simulation.textures import noise

_REACH_M = 11.0  # of clutter, from the centre of the landmarks and starts
_APART_M = 1.4
_UNKNOWN_ID = 500  # of the first tag that no map has
_MUD = np.array((122, 106, 82), np.float32)
_LEAF, _BRANCH = "0.30 0.36 0.14", "0.33 0.24 0.16"

_wear = partial(setting, group="world")


@dataclass(frozen=True)
class WearParams:
    """Parameters of a world in use."""

    tag_dirt: float = _wear(0.0, "share of each tag that is covered by dirt, 0 to 1", min=0, max=1)
    tags_covered: float = _wear(
        0.0, "share of tags with a leaf or branch across them, 0 to 1", min=0, max=1
    )
    tag_copies: int = _wear(
        0, "number of additional tags that repeat an id already in the world", min=0, max=100
    )
    clutter: int = _wear(
        0, "number of objects that only resemble tags, helipads or posts", min=0, max=200
    )


class Wear(NamedTuple):
    """Wear of one world, by its seed; see `WearParams`."""

    dirt: float = 0.0
    covered: float = 0.0
    copies: int = 0
    clutter: int = 0
    seed: int = 0

    @classmethod
    def of(cls, params: WearParams, seed: int) -> Wear:
        """The wear of a run; none is the same for all seeds."""
        given = params.tag_dirt, params.tags_covered, params.tag_copies, params.clutter
        return cls(*given, seed) if any(given) else cls()

    def soil(self, tag_id: int, canvas: Canvas) -> Canvas:
        """A tag's picture with dirt on the given share of it."""
        if not self.dirt:
            return canvas
        random = random_of(self.seed, "dirt", tag_id)
        side = len(canvas)
        patches = noise(random, side, 9) + 0.6 * noise(random, side, 24)
        height = np.quantile(patches, 1 - self.dirt)
        opaque = np.clip((patches - height) * 4, 0, 0.85)[..., None]
        return np.asarray(canvas * (1 - opaque) + _MUD * opaque, np.uint8)

    def apply(self, scene: WorldBuilder) -> None:
        """Cover tags and add clutter."""
        random = random_of(self.seed, "wear")
        tags = [one for one in scene.landmarks if one.kind == "tag"]
        for number in random.permutation(len(tags))[: round(self.covered * len(tags))]:
            _cover(scene, tags[number], random)
        places = list(islice(_places(scene, random), self.copies + self.clutter))
        for number, (x, y, turn) in enumerate(places):
            position = x, y, 0.006 + 2e-4 * number
            if number < self.copies and tags:
                scene.print_tag(tags[number % len(tags)].tag_id, position, lying(turn), 0.5)
            else:
                _add_clutter(scene, number - self.copies, position, turn, random)


def _cover(scene: WorldBuilder, tag: SimulatedLandmark, random: np.random.Generator) -> None:
    """A leaf or a branch in front of a part of a tag."""
    side, angle = tag.size, random.uniform(0, 2 * math.pi)
    along = np.array([math.cos(angle), math.sin(angle), 0.0])
    aside = np.array([-along[1], along[0], 0.0])
    local = np.column_stack([along, aside, [0.0, 0.0, 1.0]])
    is_leaf = random.random() < 0.5
    size = (0.33 * side, 0.2 * side, 0.003) if is_leaf else (0.9 * side, 0.045 * side, 0.006)
    middle = random.uniform(0.1, 0.35) * side * aside + [0.0, 0.0, 0.03]
    place = tag.R_map_landmark @ middle + tag.position_xyz
    look = _LEAF if is_leaf else _BRANCH
    scene.add("ellipsoid", size, place, look, SHOWN, tag.R_map_landmark @ local)


def _places(
    scene: WorldBuilder, random: np.random.Generator
) -> Iterator[tuple[float, float, float]]:
    """Free places x and y on the ground, each with an angle."""
    taken = [np.array(one.position_xyz[:2]) for one in scene.landmarks]
    taken += [np.array(start[:2]) for start in scene.starts.values()] or [np.zeros(2)]
    centre = np.mean(taken, axis=0)
    for _ in range(100_000):
        place: Floats = centre + random.uniform(-_REACH_M, _REACH_M, 2)
        if min(math.dist(place, other) for other in taken) > _APART_M:
            taken.append(place)
            yield float(place[0]), float(place[1]), random.uniform(0, 2 * math.pi)


def _add_clutter(
    scene: WorldBuilder,
    number: int,
    position: tuple[float, float, float],
    turn: float,
    random: np.random.Generator,
) -> None:
    """The next kind of clutter: an unknown tag, a wrong code, letters, a ring, a coloured pole."""
    kind, (x, y, _) = number % 5, position
    if kind == 0:
        scene.print_tag(_UNKNOWN_ID + number % 80, position, lying(turn), random.uniform(0.3, 0.7))
        return
    if kind == 4:
        colour = " ".join(f"{level:.2f}" for level in random.uniform(0.1, 1.0, 3))
        scene.add("cylinder", (0.06, 0.45), (x, y, 0.45), colour, SHOWN)
        return
    picture = (_draw_code, _draw_letter, _draw_ring)[kind - 1](random)
    material = scene.add_material(f"clutter_{number}", lambda: picture)
    half = random.uniform(0.3, 0.8)
    scene.add("box", (half, half, 0.001), position, material, SHOWN, lying(turn))


def _draw_code(random: np.random.Generator) -> Canvas:
    """Black and white squares of no family in a black frame."""
    bits = np.pad(np.pad(random.integers(0, 2, (6, 6)), 1), 1, constant_values=1)
    cells = np.where(bits > 0, 235, 25).astype(np.uint8).repeat(24, axis=0).repeat(24, axis=1)
    return np.repeat(cells[..., None], 3, axis=2)


def _draw_letter(random: np.random.Generator) -> Canvas:
    """A white letter on asphalt."""
    canvas = np.full((256, 256, 3), 96, np.uint8)
    letter = "HXPTE"[int(random.integers(5))]
    cv2.putText(canvas, letter, (52, 212), cv2.FONT_HERSHEY_SIMPLEX, 7.5, _WHITE, 26, cv2.LINE_AA)
    return canvas


def _draw_ring(random: np.random.Generator) -> Canvas:
    """A ring, as of a manhole or a roundabout."""
    canvas = np.full((256, 256, 3), 120, np.uint8)
    colour: Any = random.integers(60, 256, 3).tolist()
    cv2.circle(canvas, (128, 128), 96, colour, int(random.integers(8, 30)), cv2.LINE_AA)
    return canvas


_WHITE = (236, 236, 232)
