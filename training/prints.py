"""Drawings of tag boards, and of what is no landmark: signs, notices, checks, rings."""

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
    """A print that resembles a pad or a tag."""
    canvas = draw_surface(random, SIDE)
    draws = (_sign, _sign, _notice, _notice, _rings, _checks, _bars)
    draw = draws[random.integers(len(draws))]
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


def _notice(random: np.random.Generator, canvas: Canvas) -> Outline:
    """A rectangle with a figure above lines of words, as boards at roads and doors have it."""
    half = random.uniform(0.5, 1, 2)
    outline = _WHOLE * half
    paper = random_colour(random)
    ink = random_colour(random, away_from=float(np.mean(paper)))
    cv2.fillPoly(canvas, [to_pixels(outline)], paper, cv2.LINE_AA, 4)
    if random.random() < 0.6:
        rim = to_pixels(outline * random.uniform(0.85, 0.97))
        cv2.polylines(canvas, [rim], True, ink, int(random.integers(2, 10)), cv2.LINE_AA, 4)
    below = random.uniform(0, 1) if random.random() < 0.7 else 0.0  # this share is for the words
    if below < 0.8:
        room = min(0.85 * half[0], (1 - below) * half[1])
        _figure(random, canvas, np.array([0, below * half[1]]), room, ink)
    if below > 0.2:
        _words(random, canvas, (0.8 * half[0], half[1]), below, ink)
    return outline


def _figure(
    random: np.random.Generator, canvas: Canvas, middle: Outline, room: float, ink: tuple[int, ...]
) -> None:
    """A blot of nine corners, often in a triangle, square or ring."""
    paper = random_colour(random, away_from=float(np.mean(ink)))
    if random.random() < 0.5:
        frame = room * _polygon(int(random.choice([3, 3, 4, 72])), math.pi / 2)
        border = random_colour(random, away_from=float(np.mean(paper)))
        for part, colour in ((1, border), (random.uniform(0.6, 0.85), paper)):
            cv2.fillPoly(canvas, [to_pixels(part * frame + middle)], colour, cv2.LINE_AA, 4)
        room *= 0.45
    figure = room * random.uniform(0.1, 1, (9, 1)) * _polygon(9, 0)
    figure *= random.uniform(0.4, 1), 1
    cv2.fillPoly(canvas, [to_pixels(figure + middle)], ink, cv2.LINE_AA, 4)


def _words(
    random: np.random.Generator,
    canvas: Canvas,
    half: tuple[float, float],
    share: float,
    ink: tuple[int, ...],
) -> None:
    """Lines of letters in the lower share of a rectangle."""
    lines = int(random.integers(1, 5))
    pitch = 2 * share * half[1] / lines
    for number in range(lines):
        letters = random.integers(0, len(_LETTERS), random.integers(3, 12))
        text = "".join(_LETTERS[each] for each in letters)
        (wide, high), _ = cv2.getTextSize(text, 0, 1.0, 1)
        scale = min(2 * half[0] / wide, 0.6 * pitch / high) * SIDE / 2
        y = half[1] - pitch * (lines - number - 0.5)  # down
        at = (int(SIDE - wide * scale) // 2, int(SIDE * (1 + y) + high * scale) // 2)
        cv2.putText(canvas, text, at, 0, scale, ink, 1 + int(3 * scale), cv2.LINE_AA)


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
    """Road marks: parallel bars, dark or light, since those of a strong colour look like posts."""
    count = int(random.integers(2, 8))
    ink = random.uniform(0, 60) if canvas.mean() > 128 else random.uniform(190, 255)
    pitch = SIDE / count
    for number in range(count):
        start = round(number * pitch)
        canvas[SIDE // 8 : -SIDE // 8, start : start + round(pitch * 0.5)] = ink
    return _WHOLE


def _blot(random: np.random.Generator, canvas: Canvas, sides: int, radius: float) -> Outline:
    """Fill a polygon; its outline."""
    shape = radius * _polygon(sides, math.pi / sides)
    below = float(canvas[SIDE // 2, SIDE // 2].mean())
    ink = random_colour(random, away_from=below)
    cv2.fillPoly(canvas, [to_pixels(shape)], ink, cv2.LINE_AA, 4)
    return shape


def _polygon(sides: int, start: float) -> Outline:
    """The corners of a regular polygon with a radius of 1, from an angle in radians on."""
    angle = start + 2 * math.pi * np.arange(sides) / sides
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
