"""Textures of a simulated world: RGB, (height, width, 3)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.simulation.landmarks import CELLS, tag_bits

Canvas = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
Shadow = tuple[float, float, float, float]
"""Middle x and y, half lengths along the sun's direction and across it, metres."""

SUN_DEGREES = 52.0
"""Direction of shadows, from east to north."""
GRASS: Colour = (104, 132, 66)
BOARD_CELLS = CELLS + 2
"""Side of a tag's board in cells of the tag, with a white rim of one cell."""
Grains = npt.NDArray[np.float32]
FACES = "RLUDFB"
"""The order of the faces in the image of `draw_sky`, as ``gridlayout`` in MJCF."""


def draw_tag(tag_id: int, cell_px: int = 24) -> Canvas:
    """A tag of family 36h11 with its white rim."""
    cells = np.pad(tag_bits(tag_id), 1, constant_values=1)
    big = cells.repeat(cell_px, axis=0).repeat(cell_px, axis=1)
    return _rgb(np.where(big > 0, 238, 22).astype(np.uint8))


def draw_helipad(side: int = 512) -> Canvas:
    """A concrete plate with a ring and an H whose upright strokes point up."""
    random = np.random.default_rng(3)
    canvas = _shade((150, 150, 146), 1 + 0.05 * noise(random, side, 64) + _grain(random, side))
    at = side // 2
    white, yellow = (240, 240, 236), (238, 190, 40)
    cv2.circle(canvas, (at, at), int(0.44 * side), yellow, side // 26, cv2.LINE_AA)
    stroke, reach, aside = side // 11, int(0.24 * side), int(0.15 * side)
    for x in (at - aside, at + aside):
        cv2.line(canvas, (x, at - reach), (x, at + reach), white, stroke, cv2.LINE_AA)
    cv2.line(canvas, (at - aside, at), (at + aside, at), white, stroke, cv2.LINE_AA)
    return canvas


def draw_grass(side: int = 512, seed: int = 5) -> Canvas:
    """Seamless grass."""
    random = np.random.default_rng(seed)
    shade = 1 + 0.10 * _tiled(random, side, 6) + 0.12 * _tiled(random, side, 60)
    return _shade(GRASS, shade + 0.6 * _grain(random, side))


def draw_field(
    side: int, metres: float, path_xy: npt.NDArray[np.float64], shadows: Sequence[Shadow]
) -> Canvas:
    """A meadow from above, north up: mown stripes, bare patches, flowers, a gravel path.

    Args:
        side: pixels along an edge.
        metres: length of an edge; the centre is (0, 0).
        path_xy: (N, 2) metres; the closed centre line of the path.
        shadows: of all objects on it.
    """
    random = np.random.default_rng(11)
    scale = side / metres
    wide, fine = noise(random, side, 7), noise(random, side, 1100)
    x = np.arange(side, dtype=np.float32) / scale
    stripes = np.sign(np.sin((x * 0.94 + x[:, None] * 0.34) * np.pi / 1.6))
    shade = 1 + 0.10 * wide + 0.07 * noise(random, side, 90) + 0.10 * noise(random, side, 500)
    shade += 0.12 * fine + 0.8 * _grain(random, side)
    rim = np.minimum(np.minimum(x, metres - x)[:, None], np.minimum(x, metres - x))
    fade = np.clip((rim - 3) / 4, 0, 1)  # outside is plain grass
    canvas = _shade(GRASS, shade + 0.05 * stripes * fade)
    dry = np.clip(noise(random, side, 14) + 0.25 * noise(random, side, 120) - 0.45, 0, 1) * fade
    canvas = _blend(canvas, _shade((156, 146, 92), shade), np.minimum(2.2 * dry, 0.75))
    _draw_flowers(canvas, random, scale)
    middle = np.stack([side / 2 + path_xy[:, 0] * scale, side / 2 - path_xy[:, 1] * scale], axis=1)
    mask = np.zeros((side, side), np.uint8)
    line = np.round(middle * 16).astype(np.int32)
    cv2.polylines(mask, [line], True, 255, round(1.7 * scale), cv2.LINE_AA, 4)
    worn = cv2.GaussianBlur(mask, (0, 0), 0.12 * scale).astype(np.float32) / 255
    worn = np.clip(worn * 1.6 - 0.3 + 0.35 * noise(random, side, 160), 0, 1) * (worn > 0.02)
    gravel = _shade((176, 160, 130), 1 + 0.08 * wide + 0.08 * fine + 1.3 * _grain(random, side))
    canvas = _blend(canvas, gravel, worn)
    return _darken(canvas, shadows, scale)


def _darken(canvas: Canvas, shadows: Sequence[Shadow], scale: float) -> Canvas:
    half = len(canvas) // 2
    light = np.full((half, half), 255, np.uint8)
    for x, y, along, across in shadows:
        at = round((half + x * scale) * 8), round((half - y * scale) * 8)
        axes = round(along * scale * 8), round(across * scale * 8)
        cv2.ellipse(light, at, axes, -SUN_DEGREES, 0, 360, 140, -1, cv2.LINE_AA, 4)
    soft = cv2.GaussianBlur(light, (0, 0), 0.05 * scale)
    big = cv2.resize(soft, (2 * half, 2 * half), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.multiply(canvas, cv2.merge([big] * 3), scale=1 / 255))


def draw_leaves(side: int = 128) -> Canvas:
    """Foliage."""
    random = np.random.default_rng(8)
    shade = 1 + 0.35 * noise(random, side, 9) + 0.3 * noise(random, side, 26)
    return _shade((78, 112, 48), shade + _grain(random, side))


def draw_wood(side: int = 128) -> Canvas:
    """Planks of crates and boards."""
    random = np.random.default_rng(9)
    rows = np.arange(side)[:, None]
    grain = cv2.resize(noise(random, side, 24)[:, :8], (side, side))
    canvas = _shade((168, 126, 80), 1 + 0.16 * grain + 0.5 * _grain(random, side))
    canvas[np.broadcast_to(rows % (side // 4) < 2, (side, side))] = (92, 66, 40)
    return canvas


def draw_concrete(side: int = 256) -> Canvas:
    """Floor of the playpen: slabs, seamless."""
    random = np.random.default_rng(10)
    shade = 1 + 0.05 * _tiled(random, side, 8) + 0.05 * _tiled(random, side, 60)
    canvas = _shade((158, 156, 150), shade + 0.5 * _grain(random, side))
    canvas[:2] = canvas[:, :2] = (116, 114, 110)
    return canvas


def draw_grid(side: int = 256) -> Canvas:
    """Floor of the empty plane: one square metre with its rim."""
    canvas = np.full((side, side, 3), (112, 120, 130), np.uint8)
    canvas[: side // 2, : side // 2] = canvas[side // 2 :, side // 2 :] = (120, 128, 138)
    canvas[:3] = canvas[:, :3] = (158, 166, 176)
    return canvas


def noise(random: np.random.Generator, side: int, cells: int) -> Grains:
    """Smooth noise between about -1 and 1, ``cells`` to the side."""
    values = random.uniform(-1, 1, (cells, cells)).astype(np.float32)
    return np.asarray(cv2.resize(values, (side, side), interpolation=cv2.INTER_CUBIC), np.float32)


def _tiled(random: np.random.Generator, side: int, cells: int) -> Grains:
    values = random.uniform(-1, 1, (cells, cells)).astype(np.float32)
    around = np.pad(values, 2, mode="wrap")
    pixels = side * (cells + 4) // cells
    big = cv2.resize(around, (pixels, pixels), interpolation=cv2.INTER_CUBIC)
    start = 2 * side // cells
    return np.asarray(big[start : start + side, start : start + side], np.float32)


def _grain(random: np.random.Generator, side: int) -> Grains:
    return 0.06 * random.standard_normal((side, side), np.float32)


def _draw_flowers(canvas: Canvas, random: np.random.Generator, scale: float) -> None:
    side = len(canvas)
    groups = random.uniform(0, side, (40, 2))
    colours = ((236, 226, 90), (240, 240, 236), (196, 120, 176))
    for number, group in enumerate(groups):
        for x, y in random.normal(group, 0.9 * scale, (45, 2)):
            radius = random.uniform(0.02, 0.05) * scale
            at = (round(16 * x), round(16 * y))
            cv2.circle(canvas, at, round(16 * radius), colours[number % 3], -1, cv2.LINE_AA, 4)


def _shade(colour: Colour, shade: Grains) -> Canvas:
    shade = np.asarray(shade, np.float32)
    return np.asarray(cv2.merge([cv2.convertScaleAbs(shade, alpha=each) for each in colour]))


def _blend(below: Canvas, above: Canvas, weight: npt.NDArray[Any]) -> Canvas:
    weight = weight.astype(np.float32)
    return np.asarray(cv2.blendLinear(below, above, 1 - weight, weight))


def _rgb(gray: Canvas) -> Canvas:
    return np.repeat(gray[..., None], 3, axis=2)


def draw_sky(side: int = 384) -> Canvas:
    """Sky and hills: six faces of a cube side by side, RGB, (side, 6 * side, 3)."""
    return np.concatenate([_draw_face(_directions(face, side)) for face in FACES], axis=1)


def _directions(face: str, side: int) -> Grains:
    """The directions of a face's pixels in the world, (side, side, 3), z up.

    MuJoCo's cube is OpenGL's, which has y up, with its front towards y.
    """
    a = (np.arange(side, dtype=np.float32) + 0.5) / side * 2 - 1
    right, down = np.meshgrid(a, a)
    one = np.ones_like(right)
    axes = {
        "R": (one, right, -down),
        "L": (-one, -right, -down),
        "U": (right, down, one),
        "D": (right, -down, -one),
        "F": (right, -one, -down),
        "B": (-right, one, -down),
    }
    direction = np.stack(axes[face], axis=-1)
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True), np.float32)


def _draw_face(direction: Grains) -> Canvas:
    height = direction[..., 2]
    azimuth = np.arctan2(direction[..., 1], direction[..., 0])
    blue, pale = np.array((86, 140, 208)), np.array((206, 222, 236))
    sky = pale + (blue - pale) * np.clip(height, 0, 1)[..., None] ** 0.55
    sky += (np.array((250, 250, 250)) - sky) * _clouds(direction)[..., None]
    for distance, colour, level, steep in _HILLS:
        ridge = level + steep * _ridge(azimuth, distance)
        edge = np.clip((ridge - height) * 350, 0, 1)[..., None]
        sky += (np.array(colour) - sky) * edge
    return np.asarray(np.clip(sky, 0, 255), np.uint8)


_HILLS = (
    (3, (166, 186, 204), 0.060, 0.035),
    (5, (132, 158, 158), 0.034, 0.024),
    (11, (92, 118, 84), 0.014, 0.010),
)


def _ridge(azimuth: Grains, waves: int) -> Grains:
    a = waves * azimuth
    return np.asarray(
        0.5 * np.sin(a) + 0.3 * np.sin(2 * a + waves) + 0.2 * np.sin(5 * a + 2 * waves)
    )


def _clouds(direction: Grains) -> Grains:
    """Density of clouds: noise on a flat layer, thinner towards the horizon."""
    layer = np.random.default_rng(2).uniform(0, 1, (64, 64)).astype(np.float32)
    height = np.maximum(direction[..., 2], 0.03)
    x, y = direction[..., 0] / height, direction[..., 1] / height
    amount = np.zeros_like(height)
    for octave, weight in ((1.1, 0.5), (2.3, 0.28), (4.9, 0.14), (10.1, 0.08)):
        u, v = np.mod(octave * x + 17, 63), np.mod(octave * y + 29, 63)
        amount += weight * cv2.remap(layer, u, v, cv2.INTER_LINEAR)
    clear = np.clip(direction[..., 2] * 5 - 0.25, 0, 1)
    return np.asarray(np.clip((amount - 0.5) * 4.5, 0, 0.9) * clear, np.float32)
