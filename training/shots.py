"""Put a world's things about, place a camera, and say what it sees."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from bodies import yaw_quat
from outlines import Parts, View, box_of, clip_parts, hull_of, turned_sides, visible_share
from worlds import OTHER, Thing, World

from ros_visualise.geometry import rotations

Array = npt.NDArray[np.float64]
EMPTY_SHARE = 0.3
"""Fraction of pictures without a landmark."""
MOST_THINGS = 14
"""In a picture."""
_HEIGHTS_M = 0.6, 60.0
_TILT_DEGREES = 75.0
_SIZES_PX = 6.0, 400.0
_FAR_M = 200.0
_HIDDEN_GROUP = 5  # what is not in the picture
_LEAST_FACING, _FLATTEST_BOARD = 0.1, 0.35
"""Cosines between where a board looks and the camera: below the first nobody sees a tag; boards
that are no landmarks are left away below the second: from the side they look like posts."""


@dataclass(frozen=True)
class Seen:
    """One landmark in a picture.

    ``box`` is x0 y0 x1 y1 in pixels, and ``hull`` (N, 2) the convex outline, both cut at the
    picture's edges; ``point`` the ground point, which may lie outside. ``sides`` are the longer and
    the shorter side, in pixels, of the smallest rectangle around it, however turned. ``share`` is
    how much of the whole can be seen, past occluders and edges.
    """

    kind: int
    box: Array
    hull: Array
    point: Array
    sides: Array
    share: float


def take_shot(
    world: World, random: np.random.Generator, size: tuple[int, int]
) -> tuple[View, list[Seen]]:
    """Arrange the world anew; the camera's view of it, and the landmarks in that view."""
    import mujoco

    _light(world, random)
    world.model.geom_group[world.model.geom_bodyid > 0] = _HIDDEN_GROUP
    empty = random.random() < EMPTY_SHARE
    kinds = [OTHER] if empty else list(range(len(world.classes)))
    view, first, spot = _aim(world, random, size, kinds)
    placed = [(first, spot)]
    _place(world, random, first, spot)
    for _ in range(random.integers(0, MOST_THINGS)):
        kind = OTHER if empty or random.random() < 0.4 else int(random.choice(kinds))
        thing = _pick(world, random, kind)
        where = _ground_at(view, random.uniform(0, 1, 2) * size)
        if where is not None and _fits(view, thing, where, placed):
            placed.append((thing, where))
            _place(world, random, thing, where)
    mujoco.mj_kinematics(world.model, world.data)
    mujoco.mj_camlight(world.model, world.data)
    for thing, _ in placed:
        board = thing.kind == OTHER and thing.facing is not None
        if board and abs(_cosine(world, view, thing)) < _FLATTEST_BOARD:
            _hide(world, thing)
    seen = [
        one
        for thing, _ in placed
        if thing.kind != OTHER and (one := see(world, view, thing, random)) is not None
    ]
    return view, seen


def hide_landmarks(world: World) -> None:
    """Leave away all that is a landmark."""
    for thing in world.things:
        if thing.kind != OTHER:
            _hide(world, thing)


def _hide(world: World, thing: Thing) -> None:
    model = world.model
    model.geom_group[model.body_rootid[model.geom_bodyid] == thing.body] = _HIDDEN_GROUP


def _cosine(world: World, view: View, thing: Thing) -> float:
    """Cosine of the angle between a board's normal and the camera; negative from behind."""
    ahead = view.position_xyz - world.data.xpos[thing.body]
    R = world.data.xmat[thing.body].reshape(3, 3)
    return float((R @ thing.facing) @ ahead / np.linalg.norm(ahead))


def see(world: World, view: View, thing: Thing, random: np.random.Generator) -> Seen | None:
    """A thing as it is seen from a view; None where nothing of it can be."""
    data = world.data
    position, R = data.xpos[thing.body], data.xmat[thing.body].reshape(3, 3)
    if thing.facing is not None and _cosine(world, view, thing) < _LEAST_FACING:
        return None  # a board from behind, or too flat
    parts: Parts = tuple(part @ R.T + position for part in thing.parts)
    clipped = clip_parts(view, parts)
    if clipped is None or not clipped[0]:
        return None
    polygons, whole = clipped
    box = box_of(polygons)
    inside = float(np.prod(box[2:] - box[:2]) / np.prod(whole[2:] - whole[:2]))
    share = min(inside, 1.0) * visible_share(world, view, thing.body, polygons, random)
    point = view.project(position[None])[0][0]
    hull, sides = hull_of(polygons), turned_sides(polygons)
    return Seen(thing.kind, box, hull, point, sides, share) if share > 0 else None


def _aim(
    world: World, random: np.random.Generator, size: tuple[int, int], kinds: list[int]
) -> tuple[View, Thing, Array]:
    """A camera that sees a thing at a random pixel, in a random size."""
    while True:
        thing = _pick(world, random, int(random.choice(kinds)))
        focal = size[0] / 2 / math.tan(math.radians(random.uniform(25, 100)) / 2)
        R = _camera_turn(random)
        ahead = View(np.zeros(3), R, focal, size).ray(random.uniform(0, 1, 2) * size)
        wanted = math.exp(random.uniform(*np.log(_SIZES_PX)))
        distance = focal * 2 * thing.radius / wanted
        height = -distance * ahead[2]
        if ahead[2] < -0.05 and _HEIGHTS_M[0] < height < _HEIGHTS_M[1] and distance < _FAR_M:
            view = View(np.array([0.0, 0.0, height]), R, focal, size)
            return view, thing, view.position_xyz + distance * ahead


def _camera_turn(random: np.random.Generator) -> Array:
    """R_map_camera: from straight down, tilted up, turned and rolled."""
    tilt = math.radians(_TILT_DEGREES) * random.uniform(0, 1)
    yaw, roll = random.uniform(0, 2 * math.pi), random.normal(0, math.radians(8))
    if random.random() < 0.2:
        roll = random.uniform(0, 2 * math.pi)
    c, s = math.cos(tilt), math.sin(tilt)
    level = np.array([[1, 0, 0], [0, -c, s], [0, -s, -c]])
    return np.asarray(_turn(yaw) @ level @ _turn(roll))


def _turn(angle: float) -> Array:
    return np.asarray(rotations.to_matrix(np.roll(yaw_quat(angle), -1)))


def _pick(world: World, random: np.random.Generator, kind: int) -> Thing:
    fitting = [thing for thing in world.things if thing.kind == kind]
    return fitting[random.integers(len(fitting))]


def _ground_at(view: View, uv: Array) -> Array | None:
    """The ground at a pixel, if visible and not too far."""
    ahead = view.ray(uv)
    if ahead[2] > -0.03:
        return None
    distance = -view.position_xyz[2] / ahead[2]
    return view.position_xyz + distance * ahead if distance < _FAR_M else None


def _fits(view: View, thing: Thing, where: Array, placed: list[tuple[Thing, Array]]) -> bool:
    distance = float(np.linalg.norm(where - view.position_xyz))
    if not _SIZES_PX[0] < view.focal * 2 * thing.radius / distance < _SIZES_PX[1]:
        return False
    if distance < 1.2 * thing.radius or any(thing is other for other, _ in placed):
        return False
    return all(
        np.linalg.norm((where - at)[:2]) > thing.radius + other.radius for other, at in placed
    )


def _place(world: World, random: np.random.Generator, thing: Thing, where: Array) -> None:
    """Put a body on the ground, turned somehow; a board may also stand or lean."""
    model, body = world.model, thing.body
    yaw = yaw_quat(random.uniform(0, 2 * math.pi))
    model.body_pos[body] = (where[0], where[1], 0.0)
    model.body_quat[body] = yaw
    if thing.free:
        lean = 0.0 if random.random() < 0.5 else random.uniform(0, math.pi / 2)
        model.body_pos[body, 2] = 0.07 + 1.1 * thing.radius * math.sin(lean)
        c, s = math.cos(lean / 2), math.sin(lean / 2)
        model.body_quat[body] = (yaw[0] * c, yaw[0] * s, yaw[3] * s, yaw[3] * c)
    model.geom_group[model.body_rootid[model.geom_bodyid] == body] = 0


def _light(world: World, random: np.random.Generator) -> None:
    """Choose the ground, the sun and the sky's light."""
    model = world.model
    material = world.grounds[random.integers(len(world.grounds))]
    model.geom_matid[model.geom("ground").id] = material
    model.mat_rgba[material, :3] = random.uniform(0.7, 1.0, 3)
    model.mat_texrepeat[material] = math.exp(random.uniform(math.log(0.03), math.log(0.9)))
    high, turn = math.radians(random.uniform(15, 90)), random.uniform(0, 2 * math.pi)
    flat = math.cos(high)
    model.light_dir[0] = flat * math.cos(turn), flat * math.sin(turn), -math.sin(high)
    model.light_castshadow[0] = random.random() < 0.5
    tint = random.uniform(0.9, 1.1, 3)
    model.light_diffuse[0] = tint * random.uniform(0.25, 0.9)
    model.light_ambient[0] = random.uniform(0.9, 1.1, 3) * random.uniform(0.2, 0.55)
