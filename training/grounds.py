"""Random surfaces: grass, gravel, asphalt, tiles, roofs, and photos where there are some."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image

Canvas = npt.NDArray[np.uint8]
Grains = npt.NDArray[np.float32]

_NATURAL = np.array(
    [
        *((104, 132, 66), (150, 146, 92), (84, 96, 50), (176, 160, 130), (120, 96, 70)),
        *((150, 150, 146), (96, 98, 100), (60, 60, 64), (200, 190, 170), (170, 110, 80)),
        *((228, 224, 212), (130, 140, 150), (206, 196, 168), (40, 46, 40)),
    ],
    np.float32,
)
_PHOTOS = ("grass", "gravel", "brick", "coffee", "chelsea", "astronaut", "hubble_deep_field")
_PHOTOS += ("coins", "page", "moon", "ihc", "text")
"""Photos of scikit-image without vehicles and posts: no motorcycle, launch tower or tripod."""

_DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (2, -1), (1, 2), (1, -2))
"""Directions of painted lines: leaving a surface, a line re-enters where it would continue."""


def draw_surface(random: np.random.Generator, side: int, photos: Sequence[Canvas] = ()) -> Canvas:
    """A surface seen from above, RGB, (side, side, 3)."""
    if photos and random.random() < 0.3:
        return _photo(random, side, photos[random.integers(len(photos))])
    colour = _NATURAL[random.integers(len(_NATURAL))] + random.normal(0, 14, 3)
    if random.random() < 0.12:
        colour = random.uniform(10, 245, 3)
    shade = np.ones((side, side), np.float32)
    for _ in range(random.integers(1, 5)):
        cells = int(2 ** random.uniform(1, np.log2(side / 2)))
        shade += random.uniform(0, 0.22) * smooth_noise(random, side, cells)
    shade += random.uniform(0, 0.12) * random.standard_normal((side, side), np.float32)
    canvas = colour.astype(np.float32) * shade[..., None]
    second = _NATURAL[random.integers(len(_NATURAL))]
    patches = smooth_noise(random, side, int(random.integers(2, 20))) - random.uniform(0.1, 1)
    canvas += (second * shade[..., None] - canvas) * np.clip(patches * 3, 0, 1)[..., None]
    surface = np.asarray(np.clip(canvas, 0, 255), np.uint8)
    for draw in (_tiles, _stripes, paint_marks):
        if random.random() < 0.25:
            draw(random, surface)
    return surface


def _tiles(random: np.random.Generator, canvas: Canvas) -> None:
    side = len(canvas)
    wide, high = (int(each) for each in random.integers(side // 12, side // 2, 2))
    joint = max(1, round(side * random.uniform(0.002, 0.012)))
    colour = np.clip(canvas.mean((0, 1)) * random.uniform(0.5, 1.4), 0, 255).astype(np.uint8)
    for number, y in enumerate(range(0, side, high)):
        canvas[y : y + joint] = colour
        for x in range((number % 2) * wide // 2, side, wide):
            canvas[y : y + high, x : x + joint] = colour


def _stripes(random: np.random.Generator, canvas: Canvas) -> None:
    side = len(canvas)
    wave = 2 * np.pi * random.uniform(2, 40) / side
    turn = random.uniform(0, np.pi)
    x = np.arange(side, dtype=np.float32) * wave
    band = np.sin(x * np.cos(turn) + x[:, None] * np.sin(turn))
    band = np.sign(band) if random.random() < 0.5 else band
    strength = 1 + random.uniform(0.03, 0.2) * band
    canvas[:] = np.clip(canvas * strength[..., None], 0, 255)


def paint_marks(random: np.random.Generator, canvas: Canvas) -> None:
    """Painted lines and rings, which go on where the surface is laid beside itself.

    Short lines, and lines that end, look like posts.
    """
    side = len(canvas)
    for _ in range(random.integers(1, 7)):
        colour = random_colour(random) if random.random() < 0.5 else (235, 235, 230)
        start = random.integers(0, side, 2)
        wide = int(random.integers(1, max(2, side // 40)))
        ahead = _DIRECTIONS[random.integers(len(_DIRECTIONS))]
        reach = int(random.integers(4, side // 3)) if random.random() < 0.4 else 0  # of a ring
        for row in range(-2, 3):
            for column in range(-2, 3):
                a = np.add(start, (side * column, side * row)).tolist()
                if reach:
                    cv2.circle(canvas, a, reach, colour, wide, cv2.LINE_AA)
                else:
                    b = np.add(a, np.multiply(ahead, side)).tolist()
                    cv2.line(canvas, a, b, colour, wide, cv2.LINE_AA)


def _photo(random: np.random.Generator, side: int, photo: Canvas) -> Canvas:
    short = min(photo.shape[:2])
    cut = int(random.uniform(0.4, 1) * short)
    y, x = (int(random.integers(0, length - cut + 1)) for length in photo.shape[:2])
    part = cv2.resize(photo[y : y + cut, x : x + cut], (side, side), interpolation=cv2.INTER_AREA)
    part = np.rot90(part, int(random.integers(4)))
    tint = random.uniform(0.6, 1.25, 3)
    return np.ascontiguousarray(np.clip(part * tint, 0, 255), np.uint8)


@cache
def find_photos() -> tuple[Canvas, ...]:
    """The photos that come with scikit-image, or none where that is not installed."""
    try:
        import skimage
    except ImportError:
        return ()
    folder = Path(skimage.__file__).parent / "data"
    found = [path for name in _PHOTOS for path in folder.glob(f"{name}.*")]
    return tuple(np.asarray(Image.open(path).convert("RGB")) for path in found)


def smooth_noise(random: np.random.Generator, side: int, cells: int) -> Grains:
    """Smooth noise between about -1 and 1, ``cells`` to the side."""
    values = random.uniform(-1, 1, (cells, cells)).astype(np.float32)
    return np.asarray(cv2.resize(values, (side, side), interpolation=cv2.INTER_CUBIC), np.float32)


def random_colour(
    random: np.random.Generator, away_from: float | None = None
) -> tuple[int, int, int]:
    """A colour, by preference black, white, yellow or red; its mean at least 70 from a level."""
    favourites = ((240, 240, 236), (22, 22, 24), (238, 190, 40), (200, 40, 36), (60, 60, 66))
    for _ in range(20):
        if random.random() < 0.65:
            colour = np.array(favourites[random.integers(5)]) + random.normal(0, 8, 3)
        else:
            colour = random.uniform(0, 255, 3)
        if away_from is None or abs(float(np.mean(colour)) - away_from) > 70:
            break
    else:
        colour = np.full(3, 20.0 if (away_from or 0) > 127 else 235.0)
    r, g, b = (int(each) for each in np.clip(colour, 0, 255))
    return r, g, b
