"""Drawings of tag boards, and of what is no landmark: signs, crosses, checks, rings."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt
from grounds import Canvas, draw_surface, random_colour, smooth_noise
from pads import SIDE, Print, to_pixels

_DICTIONARIES = (
    *("DICT_APRILTAG_36h11", "DICT_APRILTAG_25h9", "DICT_APRILTAG_16h5", "DICT_ARUCO_ORIGINAL"),
    *("DICT_4X4_1000", "DICT_5X5_1000", "DICT_7X7_1000"),
)
_HELD_OUT_DICTIONARIES = ("DICT_6X6_1000", "DICT_APRILTAG_36h10")
_LETTERS = "ABCDEFGJKLMOPQRSTUVWXY0123456789?!&%"  # an I, N or Z lying down looks like an H

Outline = npt.NDArray[np.float64]
_WHOLE: Outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)


def draw_tag_board(random: np.random.Generator, held_out: bool = False) -> Print:
    """A square tag with its white rim, which fills the drawing; sometimes several tags."""
    names = _HELD_OUT_DICTIONARIES if held_out else _DICTIONARIES
    dictionary = cv2.aruco.getPredefinedDictionary(
        getattr(cv2.aruco, names[random.integers(len(names))])
    )
    across = 1 if random.random() < 0.8 else int(random.integers(2, 4))
    rows = [np.hstack([_tag(random, dictionary) for _ in range(across)]) for _ in range(across)]
    cells = np.vstack(rows).astype(np.uint8)
    dark, light = random.uniform(5, 60), random.uniform(190, 250)
    levels = dark + (light - dark) * cv2.resize(cells, (SIDE, SIDE), interpolation=0)
    if random.random() < 0.3:
        levels = levels + 12 * smooth_noise(random, SIDE, 5)
    picture = levels[..., None] * random.uniform(0.92, 1.05, 3)
    return Print(np.asarray(np.clip(picture, 0, 255), np.uint8), _WHOLE)


def _tag(random: np.random.Generator, dictionary: cv2.aruco.Dictionary) -> npt.NDArray[np.uint8]:
    """The cells of a random tag of a dictionary, 1 is white, with a white rim of one cell."""
    side = dictionary.markerSize
    codes = dictionary.bytesList
    length = math.ceil(side * side / 8)
    code = np.ravel(codes[random.integers(len(codes))])[:length]  # then come its turns
    bits = np.unpackbits(code)
    rest = side * side - 8 * (length - 1)
    inner = np.concatenate([bits[: 8 * (length - 1)], bits[-rest:]]).reshape(side, side)
    return np.asarray(np.pad(np.pad(inner, 1), 1, constant_values=1))


def draw_distractor(random: np.random.Generator) -> Print:
    """What could be taken for a pad or a tag and is none."""
    canvas = draw_surface(random, SIDE)
    draw = (_sign, _sign, _cross, _rings, _checks, _bars)[random.integers(6)]
    return Print(canvas, draw(random, canvas))


def _sign(random: np.random.Generator, canvas: Canvas) -> Outline:
    """A letter, a number or a word in a frame, as pads have it."""
    radius = random.uniform(0.6, 0.95)
    sides = int(random.choice([3, 4, 6, 8, 72]))
    outline = _blot(random, canvas, sides, radius)
    if random.random() < 0.6:
        _blot(random, canvas, sides, radius * random.uniform(0.7, 0.93))
    count = int(random.choice([1, 1, 1, 2, 4]))
    text = "".join(_LETTERS[each] for each in random.integers(0, len(_LETTERS), count))
    font = int(random.choice([0, 2, 3, 4]))
    thick = int(random.integers(4, 26)) // count + 1
    (wide, high), _ = cv2.getTextSize(text, font, 1.0, 1)
    scale = random.uniform(0.3, 0.6) * radius * SIDE / max(wide, high)
    at = (int(SIDE - wide * scale) // 2, int(SIDE + high * scale) // 2)
    ink = random_colour(random, away_from=float(canvas[SIDE // 2, SIDE // 2].mean()))
    cv2.putText(canvas, text, at, font, scale, ink, thick, cv2.LINE_AA)
    return outline


def _cross(random: np.random.Generator, canvas: Canvas) -> Outline:
    reach, half = random.uniform(0.5, 0.95), random.uniform(0.08, 0.3)
    turn = random.choice([0, math.pi / 4])
    c, s = math.cos(turn), math.sin(turn)
    ink = random_colour(random, away_from=float(canvas.mean()))
    for w, h in ((reach, half * reach), (half * reach, reach)):
        bar = np.array([[-w, -h], [w, -h], [w, h], [-w, h]]) @ np.array([[c, s], [-s, c]])
        cv2.fillPoly(canvas, [to_pixels(bar)], ink, cv2.LINE_AA, 4)
    return _WHOLE


def _rings(random: np.random.Generator, canvas: Canvas) -> Outline:
    """A target, a roundabout, a manhole: rings without a letter."""
    sides = int(random.choice([4, 8, 72, 72]))
    radius = random.uniform(0.6, 0.97)
    outline = _blot(random, canvas, sides, radius)
    for _ in range(random.integers(0, 5)):
        radius *= random.uniform(0.5, 0.9)
        _blot(random, canvas, sides, radius)
    return outline


def _checks(random: np.random.Generator, canvas: Canvas) -> Outline:
    count = int(random.integers(2, 9))
    cells = np.add.outer(np.arange(count), np.arange(count)) % 2
    big = cv2.resize(cells.astype(np.uint8), (SIDE, SIDE), interpolation=0)
    first = random_colour(random)
    second = random_colour(random, away_from=float(np.mean(first)))
    canvas[:] = np.where(big[..., None] > 0, first, second)
    return _WHOLE


def _bars(random: np.random.Generator, canvas: Canvas) -> Outline:
    """Road marks, crossings, containers: parallel bars."""
    count = int(random.integers(2, 8))
    ink = random_colour(random, away_from=float(canvas.mean()))
    pitch = SIDE / count
    for number in range(count):
        start = round(number * pitch)
        canvas[SIDE // 8 : -SIDE // 8, start : start + round(pitch * 0.5)] = ink
    return _WHOLE


def _blot(random: np.random.Generator, canvas: Canvas, sides: int, radius: float) -> Outline:
    """Fill a polygon; its outline."""
    angle = math.pi / sides + 2 * math.pi * np.arange(sides) / sides
    shape = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    below = float(canvas[SIDE // 2, SIDE // 2].mean())
    ink = random_colour(random, away_from=below)
    cv2.fillPoly(canvas, [to_pixels(shape)], ink, cv2.LINE_AA, 4)
    return shape
