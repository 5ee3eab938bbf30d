"""A random world as one MuJoCo model: grounds, landmarks and what is none, to be put about."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from bodies import build_post, build_thing, build_vehicle, geom, gray
from grounds import Canvas, draw_surface, find_photos
from outlines import Array, Parts, body_parts
from pads import Print, draw_pad
from prints import draw_distractor, draw_tag_board

from ros_visualise.core.errors import OpenError
from ros_visualise.simulation.textures import FACES

CLASSES = ("helipad", "tag", "post", "vehicle")
OTHER = -1
"""The class of what is no landmark."""
_GROUNDS = 10
_COUNTS = {
    "helipad": 18,
    "tag": 10,
    "post": 12,
    "vehicle": 10,
    "sign": 12,
    "board": 6,
    "thing": 16,
}
_PLATE = 0.012  # half the thickness of what is drawn on, metres
_CUT = 0.6  # of the signs, and of the pads with a frame
_PAINTED = 0.7  # of the letters and crosses without a frame: nothing but their strokes is there
_PAPER = 1.03, 1.25  # of the rest: what they are printed on, by what is printed
_PIXELS = (
    '<visual><headlight active="0"/><map znear="0.01" zfar="50"/>'
    '<quality shadowsize="1024" offsamples="4" numslices="20" numstacks="12"/></visual>'
    '<statistic center="0 0 1" extent="10"/>'
)
_FIXED = (
    '<camera name="eye"/><light name="sun" directional="true" pos="0 0 30" dir="0 0 -1"/>'
    '<geom name="ground" type="plane" size="150 150 1" material="ground0"/>'
)


@dataclass(frozen=True)
class Thing:
    """A body that can be put somewhere.

    ``parts`` are convex groups of points in the body's frame, metres: a box is drawn around them.
    The body's origin is its ground point. What is ``free`` may also stand or lean. ``facing`` is
    the direction, in the body's frame, in which the picture of a board looks; others have none.
    """

    body: int
    kind: int
    parts: Parts
    free: bool = False
    facing: tuple[float, float, float] | None = None

    @cached_property
    def radius(self) -> float:
        """Radius of the bounding ball around its origin, metres."""
        return max(float(np.linalg.norm(part, axis=1).max()) for part in self.parts)


@dataclass(frozen=True)
class World:
    """The model, its things, and the materials that the ground can have."""

    model: Any
    data: Any
    things: tuple[Thing, ...]
    grounds: tuple[int, ...]
    classes: tuple[str, ...]


class Named(NamedTuple):
    """A thing of a model to be compiled; without ``parts`` the outline is that of its geoms."""

    name: str
    kind: int
    parts: Parts | None = None
    free: bool = False
    facing: tuple[float, float, float] | None = None


def build_world(
    random: np.random.Generator, held_out: bool = False, own: Sequence[Path] = ()
) -> World:
    """Draw all anew and compile it.

    Args:
        held_out: with styles that are never trained on.
        own: MJCF files; the first body of each is a class more, named after the body.

    Raises:
        OpenError: a file of ``own`` cannot be read, or has no body.
    """
    import mujoco

    bodies = [_first_body(path) for path in own]
    names = [str(body.name) for body in bodies]
    writer = _Writer(random, held_out)
    for kind, count in _COUNTS.items():
        for number in range(count):
            writer.add_thing(kind, f"{kind}{number}")
    spec = mujoco.MjSpec.from_string(writer.mjcf(), assets=writer.assets)
    for number, body in enumerate(bodies):
        spec.worldbody.add_frame().attach_body(body, f"own{number}_", "")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    things = []
    own_things = [Named(f"own{at}_{name}", len(CLASSES) + at) for at, name in enumerate(names)]
    for name, kind, parts, free, facing in [*writer.things, *own_things]:
        body = model.body(name).id
        things.append(Thing(body, kind, parts or body_parts(model, data, body), free, facing))
    grounds = tuple(model.material(f"ground{number}").id for number in range(_GROUNDS))
    return World(model, data, tuple(things), grounds, (*CLASSES, *names))


def _first_body(path: Path) -> Any:
    """The first body of a MJCF file."""
    import mujoco

    try:
        body = mujoco.MjSpec.from_file(str(path)).worldbody.first_body()
    except ValueError as error:
        raise OpenError(f"{path}: no MJCF file: {' '.join(str(error).split())}") from error
    if body is None or not body.name:
        raise OpenError(f"{path}: its <worldbody> needs a <body> with a name, its origin the foot")
    return body


def _sheet(outline_xy: Array, larger: float) -> Array:
    """The paper that an outline is printed on: a rectangle about it, so many times as large."""
    low, high = outline_xy.min(axis=0), outline_xy.max(axis=0)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray((low + high) / 2 + corners * larger * (high - low) / 2)


def _flat_mesh(name: str, outline_xy: Array, half: float) -> str:
    """A drawing cut along a convex outline, as a MJCF mesh whose upper face shows it."""
    count = len(outline_xy)
    top = np.hstack([outline_xy * half, np.full((count, 1), 2 * _PLATE)])
    at = np.vstack([outline_xy * (0.5, -0.5) + 0.5, [[0.5, 0.5]]])
    faces = [(0, number, number + 1) for number in range(1, count - 1)]
    faces += [(number, count, (number + 1) % count) for number in range(count)]
    normals = [(0, 0, 1)] * count + [(0, 0, -1)]
    lists = {"vertex": [*top, np.zeros(3)], "normal": normals, "texcoord": at, "face": faces}
    text = " ".join(
        f'{key}="{" ".join(f"{each:.6g}" for each in np.ravel(rows))}"'
        for key, rows in lists.items()
    )
    return f'<mesh name="{name}" inertia="shell" {text}/>'


class _Writer:
    """Writes a world's MJCF; ``things`` are what is in it."""

    def __init__(self, random: np.random.Generator, held_out: bool) -> None:
        self.random, self.held_out = random, held_out
        self.assets: dict[str, bytes] = {}
        self.things: list[Named] = []
        self._definitions: list[str] = []
        self._bodies: list[str] = []
        photos = () if held_out else find_photos()
        for number in range(_GROUNDS):
            self._add_material(f"ground{number}", draw_surface(random, 512, photos), 0.3)
        self._add_sky()

    def mjcf(self) -> str:
        return (
            f"<mujoco>{_PIXELS}<asset>{''.join(self._definitions)}</asset>"
            f"<worldbody>{_FIXED}{''.join(self._bodies)}</worldbody></mujoco>"
        )

    def add_thing(self, kind: str, name: str) -> None:
        """Add one body of a kind."""
        random = self.random
        number = CLASSES.index(kind) if kind in CLASSES else OTHER
        if kind == "helipad":
            self._add_print(name, draw_pad(random, self.held_out), random.uniform(1, 5), number)
        elif kind == "tag":
            self._add_print(name, draw_tag_board(random, self.held_out), 1.0, number)
        elif kind == "sign":
            size = random.uniform(1, 5)
            self._add_print(name, draw_distractor(random), size, number)
        elif kind == "board":
            self._add_board(name, draw_distractor(random))
        elif kind == "post":
            self._add_body(build_post(random), Named(name, number))
        elif kind == "vehicle":
            mesh, geoms = build_vehicle(random, name, self.held_out)
            self._definitions.append(mesh)
            self._add_body(geoms, Named(name, number))
        else:
            self._add_material(name, draw_surface(random, 128), 0.5)
            self._add_body(build_thing(random, name), Named(name, number))

    def _add_print(self, name: str, drawn: Print, size: float, number: int) -> None:
        """A plate with a drawing; a tag's is a board with an edge, and stands as it likes.

        Most pads and signs are cut out along the outline, as if painted on the ground. A pad
        without a frame always is, and most are strokes without a plate: nobody could tell the
        plate's edge from the pad's. A board's
        edge is gray: with a strong colour it would look like a post from the side.
        """
        self._add_material(name, drawn.picture)
        half, board = size / 2, number == CLASSES.index("tag")
        if board:
            rim = half * self.random.uniform(1.0, 1.12)
            geoms = geom("box", (half, half, _PLATE), (0, 0, -_PLATE), name)
            geoms += geom("box", (rim, rim, 0.02), (0, 0, -2 * _PLATE - 0.02), gray(self.random))
        else:
            is_pad = number == CLASSES.index("helipad")
            if drawn.strokes and self.random.random() < _PAINTED:
                edges = list(drawn.strokes)
            else:
                edges = [self._edge(drawn, is_pad and not drawn.framed)]
            geoms = self._cut_out(name, edges, half)
        z = np.full((len(drawn.outline_xy), 1), 0 if board else 2 * _PLATE)
        outline = np.hstack([drawn.outline_xy * half, z])
        facing = (0.0, 0.0, 1.0) if board else None
        self._add_body(geoms, Named(name, number, (outline,), board, facing))

    def _add_board(self, name: str, drawn: Print) -> None:
        """A board that stands on a gray pole, some of them askew."""
        self._add_material(name, drawn.picture)
        half = self.random.uniform(0.2, 0.8)
        edge = self._edge(drawn, False)
        askew = self.random.uniform(-45, 45) if self.random.random() < 0.3 else 0.0
        middle = math.hypot(half, half if askew else 0) + self.random.uniform(0.1, 2)
        radius = self.random.uniform(0.02, 0.05)
        pole = geom("cylinder", (radius, middle / 2), (0, radius, middle / 2), gray(self.random))
        self._definitions.append(_flat_mesh(name, np.clip(edge, -1, 1), half))
        turned = f'mesh="{name}" euler="90 0 {askew:.0f}"'
        plate = geom("mesh", (), (0, 0, middle), name, turned)
        self._add_body(pole + plate, Named(name, OTHER, facing=(0.0, -1.0, 0.0)))

    def _edge(self, drawn: Print, along: bool) -> Array:
        """The edge of what a drawing is on: along its outline, or a sheet of paper."""
        if along or self.random.random() < _CUT:
            return np.asarray(self.random.uniform(1.0, 1.06) * drawn.outline_xy)
        return _sheet(drawn.outline_xy, self.random.uniform(*_PAPER))

    def _cut_out(self, name: str, edges: Sequence[Array], half: float) -> str:
        """Geoms of convex pieces of a drawing, flat on the ground."""
        names = [f"{name}_{number}" for number in range(len(edges))]
        for each, edge in zip(names, edges, strict=True):
            self._definitions.append(_flat_mesh(each, np.clip(edge, -1, 1), half))
        at = (0, 0, 0)
        return "".join(geom("mesh", (), at, name, f'mesh="{each}"') for each in names)

    def _add_body(self, geoms: str, thing: Named) -> None:
        self._bodies.append(f'<body name="{thing.name}">{geoms}</body>')
        self.things.append(thing)

    def _add_material(self, name: str, picture: Canvas, repeat: float | None = None) -> None:
        self._store(name, picture)
        tiling = f'texuniform="true" texrepeat="{repeat} {repeat}"' if repeat else ""
        shine = self.random.uniform(0, 0.4) if self.random.random() < 0.3 else 0.0
        self._definitions.append(
            f'<texture name="{name}" type="2d" file="{name}.png"/>'
            f'<material name="{name}" texture="{name}" specular="{shine:.2f}" {tiling}/>'
        )

    def _add_sky(self) -> None:
        """A sky of two colours, or of some surface."""
        low, high = self.random.uniform(90, 255, (2, 3))
        if self.random.random() < 0.5:
            faces = np.hstack([draw_surface(self.random, 64) for _ in FACES])
        else:
            share = np.linspace(0, 1, 64)[:, None, None]
            side = np.broadcast_to(high + (low - high) * share, (64, 64, 3))
            flat = {"U": np.broadcast_to(high, side.shape), "D": np.broadcast_to(low, side.shape)}
            faces = np.hstack([flat.get(face, side) for face in FACES]).astype(np.uint8)
        self._store("sky", faces)
        self._definitions.append(
            f'<texture type="skybox" file="sky.png" gridsize="1 6" gridlayout="{FACES}"/>'
        )

    def _store(self, name: str, picture: Canvas) -> None:
        quick = [cv2.IMWRITE_PNG_COMPRESSION, 0]
        _, data = cv2.imencode(".png", np.ascontiguousarray(picture[..., ::-1]), quick)
        self.assets[f"{name}.png"] = data.tobytes()
