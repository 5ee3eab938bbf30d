"""Worlds as MJCF."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.simulation.landmarks import CELLS, SimulatedLandmark
from ros_visualise.simulation.textures import BOARD_CELLS, draw_tag

Canvas = npt.NDArray[np.uint8]
Draw = Callable[[], Canvas]

GROUND = 'contype="1" conaffinity="0"'
SOLID = 'contype="2" conaffinity="0"'
SHOWN = 'contype="0" conaffinity="0"'  # without contacts
_BOARD_THICKNESS = 0.024
PRINT_THICKNESS = 0.002  # of a tag on its board
SKY = "sky"
_PLAIN = np.full((2, 2, 3), 128, np.uint8)


Pose2 = tuple[float, float, float]
"""x and y in metres, yaw in radians."""


class WorldBuilder:
    """Builds a world.

    Args:
        pictures: draw the textures; otherwise all is gray, and ready much sooner.

    Attributes:
        textures: names in the MJCF -> images, RGB; the faces of the sky are side by side.
        landmarks: those added so far.
        starts: robot -> start; the default is the origin.
        path_xy: a closed path through the world.
    """

    def __init__(self, pictures: bool) -> None:
        self._pictures = pictures
        self._soil: Callable[[int, Canvas], Canvas] = lambda tag_id, canvas: canvas
        self._printed: set[int] = set()
        self.textures: dict[str, Canvas] = {}
        self.landmarks: list[SimulatedLandmark] = []
        self.starts: dict[str, Pose2] = {}
        self.path_xy: list[tuple[float, float]] = []
        self._definitions: list[str] = []
        self._things: list[str] = []

    def worn(self, soil: Callable[[int, Canvas], Canvas]) -> WorldBuilder:
        """A copy whose tags look worn: ``soil`` changes the picture of a tag with an id."""
        world = deepcopy(self)
        world._soil = soil
        for tag_id in self._printed:
            world._store(f"tag_{tag_id}", partial(world._draw_tag, tag_id))
        return world

    def mjcf(self) -> str:
        """The sections ``visual``, ``asset`` and ``worldbody`` of the MJCF."""
        return (
            f"{_VISUAL}<asset>{''.join(self._definitions)}</asset>"
            f"<worldbody>{_SUN}{''.join(self._things)}</worldbody>"
        )

    def add_sky(self, draw: Draw) -> None:
        """Surround everything with a cube, six faces side by side, as `draw_sky` has them."""
        self._store(SKY, draw, np.full((2, 12, 3), 200, np.uint8))
        side = len(self.textures[SKY])
        self._definitions.append(_texture(SKY, "skybox", side, 6 * side))

    def add_material(
        self, name: str, draw: Draw, repeat: float | None = None, kind: str = "2d"
    ) -> str:
        """A textured material: once over a geom, or ``repeat`` times per metre."""
        self._store(name, draw)
        tiling = f'texuniform="true" texrepeat="{repeat} {repeat}"' if repeat else ""
        height, width = self.textures[name].shape[:2]
        self._definitions.append(
            f"{_texture(name, kind, width, height)}"
            f'<material name="{name}" texture="{name}" specular="0" {tiling}/>'
        )
        return name

    def add(
        self,
        shape: str,
        size: Sequence[float],
        position: Sequence[float] | Floats,
        look: str,
        contact: str = SOLID,
        R: Floats | None = None,
        yaw: float = 0.0,
        name: str = "",
    ) -> None:
        """Add a geom. ``look`` is a material's name, or red, green and blue from 0 to 1."""
        axes = _turn(yaw) if R is None else R
        xyaxes = _numbers([*axes[:, 0], *axes[:, 1]])
        paint = f'rgba="{look} 1"' if " " in look else f'material="{look}"'
        named = f'name="{name}"' if name else ""
        self._things.append(
            f'<geom {named} type="{shape}" size="{_numbers(size)}" pos="{_numbers(position)}" '
            f'xyaxes="{xyaxes}" {paint} {contact}/>'
        )

    def add_ground(self, half: float, look: str) -> None:
        """Add the ground plane, drawn to ``half`` metres each way."""
        self.add("plane", (half, half, 1), (0, 0, 0), look, GROUND, name="ground")

    def add_board(
        self, tag_id: int, position: tuple[float, float, float], R: Floats, size: float
    ) -> None:
        """Add a wooden board with an AprilTag whose black square is ``size`` metres wide.

        Args:
            position: centre of the tag.
            R: R_map_landmark, see `SimulatedLandmark`.
        """
        half = self.print_tag(tag_id, position, R, size)
        behind = np.asarray(position) - R[:, 2] * (PRINT_THICKNESS + _BOARD_THICKNESS / 2)
        rim = half + 0.02
        self.add("box", (rim, rim, _BOARD_THICKNESS / 2), behind, "0.45 0.32 0.2", SOLID, R)
        self.landmarks.append(SimulatedLandmark(f"tag_{tag_id}", "tag", position, R, size, tag_id))

    def print_tag(
        self, tag_id: int, position: Sequence[float] | Floats, R: Floats, size: float
    ) -> float:
        """Add an AprilTag as on a sheet of paper; returns half the side of the sheet."""
        name = f"tag_{tag_id}"
        if tag_id not in self._printed:
            self._printed.add(tag_id)
            self.add_material(name, partial(self._draw_tag, tag_id))
        half = size * BOARD_CELLS / CELLS / 2
        behind = np.asarray(position) - R[:, 2] * PRINT_THICKNESS / 2
        self.add("box", (half, half, PRINT_THICKNESS / 2), behind, name, SHOWN, R)
        return half

    @contextmanager
    def body(self, name: str, position: Sequence[float], yaw: float, inner: str) -> Iterator[None]:
        """Group what is added meanwhile into a body; ``inner`` is MJCF of its joints."""
        outside, self._things = self._things, []
        yield
        turn = f'euler="0 0 {math.degrees(yaw):.6g}"'
        things = "".join(self._things)
        opening = f'<body name="{name}" pos="{_numbers(position)}" {turn}>'
        self._things = [*outside, f"{opening}{inner}{things}</body>"]

    def _draw_tag(self, tag_id: int) -> Canvas:
        return self._soil(tag_id, draw_tag(tag_id))

    def _store(self, name: str, draw: Draw, plain: Canvas = _PLAIN) -> None:
        self.textures[name] = draw() if self._pictures else plain


def _texture(name: str, kind: str, width: int, height: int) -> str:
    """A texture of that size, whose pixels `fill_textures` sets."""
    size = f'width="{width}" height="{height}"'
    return f'<texture name="{name}" type="{kind}" builtin="flat" colorspace="linear" {size}/>'


def fill_textures(model: Any, textures: Mapping[str, Canvas]) -> None:
    """Set the pixels of an ``mjModel``'s textures: as files they would be packed and unpacked."""
    for name, picture in textures.items():
        texture = model.texture(name)
        pixels = np.concatenate(np.split(picture, 6, axis=1)) if name == SKY else picture
        space = model.tex_data[texture.adr[0] :][: 3 * texture.width[0] * texture.height[0]]
        space.reshape(-1, pixels.size)[:] = pixels.ravel()  # the faces of a cube are alike


def _turn(yaw: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _numbers(values: Sequence[float] | Floats) -> str:
    return " ".join(f"{value:.6g}" for value in values)


_VISUAL = """
<statistic center="0 0 1" extent="10"/>
<visual>
  <headlight active="0"/>
  <map znear="0.005" zfar="30"/>
  <quality shadowsize="2048" offsamples="0" numslices="20" numstacks="12"/>
</visual>"""

SUN_SLOPE = 0.70
"""Offset of shadows per metre of height."""
_SUN = (
    '<light directional="true" pos="0 0 30" dir="0.35 0.45 -0.82" '
    'ambient="0.42 0.43 0.46" diffuse="0.68 0.66 0.60" specular="0.2 0.2 0.2" castshadow="false"/>'
)
