"""Drawings of helipads in many styles, with the outline of what is painted."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from grounds import Canvas, draw_surface, random_colour, smooth_noise

SIDE = 288
"""Pixels along a drawing's edge."""
FRAMES = (
    *("circle", "double_circle", "ellipse", "hexagon", "octagon"),
    *("square", "triangle", "rounded", "cross", "cross", "none", "none", "none"),
)
"""A bare letter and one on a cross are drawn more often: they have no edge that helps."""
HELD_OUT_FRAMES = ("pentagon", "diamond")
LETTERS = ("plain", "round", "stencil", "wide", "edged", "serif", "hollow", "cross", "cross")
"""Styles of the H; ``cross`` is a cross in its place, drawn more often."""
HELD_OUT_LETTERS = ("slanted", "flared")
_SIDES = {"triangle": 3, "square": 4, "diamond": 4, "pentagon": 5, "hexagon": 6, "octagon": 8}
_TURNS = {
    "triangle": math.pi / 2,
    "square": math.pi / 4,
    "pentagon": math.pi / 2,
    "octagon": math.pi / 8,
}
_ROOM = {"triangle": 0.6, "diamond": 0.75}
"""Scale of a letter in a frame with sharp corners."""
_LEGIBLE = 1.5  # standard deviations
Strokes = tuple[npt.NDArray[np.float64], ...]
_ONE = 1 << 4  # of cv2's fixed point, 4 bits


class Print(NamedTuple):
    """A flat drawing: RGB, (SIDE, SIDE, 3), and the outline of what is meant on it.

    ``outline_xy`` is (N, 2), convex, in half sides of the drawing, x right and y up. ``framed``
    is what has an edge of its own, so that what it is printed on may go on beyond it. ``strokes``
    are convex pieces, like the outline, of what can be painted on any ground without a plate.
    """

    picture: Canvas
    outline_xy: npt.NDArray[np.float64]
    framed: bool = False
    strokes: Strokes = ()


def draw_pad(random: np.random.Generator, held_out: bool = False) -> Print:
    """A helipad of a random style: frame, letter, colours, decorations, wear.

    One whose letter nobody could tell from what is below it is drawn anew.

    Args:
        held_out: take the styles that are never trained on.
    """
    while True:
        pad, letter = draw_any_pad(random, held_out)
        if _stands_out(pad.picture, letter) > _LEGIBLE:
            return pad


def draw_any_pad(random: np.random.Generator, held_out: bool) -> tuple[Print, Canvas]:
    """A helipad, legible or not, and where its letter is: 255 in (SIDE, SIDE)."""
    frame = str(random.choice(HELD_OUT_FRAMES if held_out else FRAMES))
    letter = str(random.choice(HELD_OUT_LETTERS if held_out else LETTERS))
    if (frame, letter) == ("cross", "cross"):
        frame = "none"
    under = draw_surface(random, SIDE)
    if random.random() < 0.25:  # white paper
        under = np.asarray(np.clip(under * 0.06 + random.uniform(215, 240), 0, 255), np.uint8)
    below = float(under.mean())
    fill = random_colour(random, away_from=below) if random.random() < 0.6 else None
    ground = below if fill is None else float(np.mean(fill))
    ink = random_colour(random, away_from=ground)
    radius = random.uniform(0.55, 0.93)
    paint = under.copy()
    outline, bars = _draw_frame(random, paint, frame, radius, fill, ink)
    usual = radius * (0.62 if frame not in ("none", "cross") else 1.0) * _ROOM.get(frame, 1.0)
    reach = usual * random.uniform(0.6, 1.0)
    second = random_colour(random, away_from=ground) if random.random() < 0.3 else ink
    mask, corners, strokes = _draw_letter(random, letter, reach)
    if letter == "edged":
        edge = random.uniform(0.04, 0.13) * reach
        corners = corners + edge * np.sign(corners)
        _stamp(paint, _widened(mask, edge), second)
        second = random_colour(random, away_from=float(np.mean(second)))
    _stamp(paint, mask, second)
    if frame not in ("none", "cross"):
        _decorate(random, paint, radius, reach, ink)
    outline = corners if outline is None else outline
    framed = frame not in ("none", "cross")
    strokes = () if framed else bars or strokes
    return Print(_wear(random, paint, under), outline, framed, strokes), mask


def _stands_out(picture: Canvas, letter: Canvas) -> float:
    """Contrast of the letter to its surroundings, in standard deviations of both."""
    x, y, w, h = cv2.boundingRect(letter)
    part, inside = picture[y : y + h, x : x + w], letter[y : y + h, x : x + w] > 127
    a, b = (part[each].astype(np.float64) for each in (inside, ~inside))
    spread = np.sqrt((a.var(axis=0).sum() + b.var(axis=0).sum()) / 2)
    return float(np.linalg.norm(a.mean(axis=0) - b.mean(axis=0)) / max(spread, 1.0))


def _draw_frame(
    random: np.random.Generator,
    canvas: Canvas,
    frame: str,
    radius: float,
    fill: tuple[int, ...] | None,
    ink: tuple[int, ...],
) -> tuple[npt.NDArray[np.float64] | None, Strokes]:
    """Paint the frame; returns its outline, or None without a frame, and the bars of a cross."""
    if frame == "none":
        return None, ()
    if frame == "cross":
        return _draw_cross(random, canvas, radius, fill, ink)
    shape = _polygon(frame, radius, random)
    stroke = random.uniform(0.025, 0.12) * radius
    if fill is not None:
        _fill(canvas, shape, fill)
    if fill is None or random.random() < 0.5:
        inset = 1.0 if fill is None or random.random() < 0.4 else random.uniform(0.82, 0.96)
        outer = shape * inset
        if random.random() < (0.0 if inset == 1.0 else 0.4):
            _dash(random, canvas, outer, stroke * 0.5, ink)
        else:
            _ring(canvas, outer, stroke, ink)
        if frame == "double_circle" or random.random() < 0.15:
            _ring(canvas, outer * random.uniform(0.7, 0.85), stroke * 0.7, ink)
    return shape, ()


def _draw_cross(
    random: np.random.Generator,
    canvas: Canvas,
    radius: float,
    fill: tuple[int, ...] | None,
    ink: tuple[int, ...],
) -> tuple[npt.NDArray[np.float64], Strokes]:
    """The broad cross of hospitals under the H, filled, outlined or both: its hull and bars."""
    r, s = radius, random.uniform(0.36, 0.5) * radius
    if fill is not None:
        _fill(canvas, _cross(r, s), fill)
    if fill is None or random.random() < 0.3:
        wide = max(2, round(random.uniform(0.02, 0.08) * radius * SIDE / 2))
        half = wide / SIDE
        points = to_pixels(_cross(r - half, s - half))
        cv2.polylines(canvas, [points], True, ink, wide, cv2.LINE_AA, 4)
    hull = np.array([[r, s], [s, r], [-s, r], [-r, s], [-r, -s], [-s, -r], [s, -r], [r, -s]])
    return hull, (_rectangle(-r, -s, r, s), _rectangle(-s, -r, s, r))


def _cross(reach: float, half: float) -> npt.NDArray[np.float64]:
    """The corners of a cross whose bars are so long and wide, from the middle."""
    r, s = reach, half
    right = [(s, -r), (s, -s), (r, -s), (r, s), (s, s), (s, r)]
    return np.array([*right, *[(-x, -y) for x, y in right]], np.float64)


def _polygon(frame: str, radius: float, random: np.random.Generator) -> npt.NDArray[np.float64]:
    sides = _SIDES.get(frame, 72)
    turn = _TURNS.get(frame, 0.0)
    angle = turn + 2 * math.pi * np.arange(sides) / sides
    shape = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if frame == "rounded":  # a superellipse
        shape = np.sign(shape) * np.abs(shape) ** random.uniform(0.3, 0.6)
    if frame == "square":
        shape *= math.sqrt(2) * 0.9
    if frame in ("ellipse", "diamond"):
        shape *= (1.0, random.uniform(0.7, 0.9))
    if frame == "triangle":
        shape = shape - np.array([0, 0.1])
    return np.asarray(np.clip(radius * shape, -0.98, 0.98))


def _draw_letter(
    random: np.random.Generator, letter: str, reach: float
) -> tuple[Canvas, npt.NDArray[np.float64], Strokes]:
    """An H with half the height ``reach`` or less, 255 in (SIDE, SIDE), its corners and strokes."""
    up = reach * 0.85
    if letter == "cross":
        return _draw_plus(random, up)
    aside = up * (random.uniform(0.9, 1.15) if letter == "wide" else random.uniform(0.5, 0.85))
    stroke = min(up * random.uniform(0.14, 0.34), 0.42 * aside)
    inner = aside - 2 * stroke * 0.8
    stems = [_rectangle(-aside, -up, -inner, up), _rectangle(inner, -up, aside, up)]
    bar = _rectangle(-aside, -stroke * 0.7, aside, stroke * 0.7)
    if letter == "serif":
        for x in (-aside, inner):
            for y in (-up, up - 0.5 * stroke):
                stems.append(_rectangle(x - 0.5 * stroke, y, x + 2.1 * stroke, y + 0.5 * stroke))
        aside += 0.5 * stroke
    if letter == "flared":
        wider = random.uniform(0.3, 0.6) * stroke
        stems = [_flared(stem, wider) for stem in stems]
        aside += wider
    lean = random.uniform(0.15, 0.35) if letter == "slanted" else 0.0
    mask = np.zeros((SIDE, SIDE), np.uint8)
    strokes = tuple(_leant(shape, lean) for shape in (*stems, bar))
    for shape in strokes:
        _fill(mask, shape, (255,))
    if letter == "round":
        size = max(3, round(0.5 * stroke * SIDE / 2)) | 1
        mask = cv2.threshold(cv2.GaussianBlur(mask, (0, 0), size / 2), 127, 255, 0)[1]
    if letter == "hollow":
        rim = max(1, round(0.45 * stroke * SIDE / 2))
        mask = mask - cv2.erode(mask, np.ones((2 * rim + 1, 2 * rim + 1), np.uint8))
    if letter == "stencil":
        gap = round(0.12 * stroke * SIDE / 2) + 2
        for x in (-aside + 1.6 * stroke, aside - 1.6 * stroke):
            at = round((1 + x) * SIDE / 2)
            mask[:, at - gap // 2 : at + gap // 2 + 1] = 0
    return mask, _leant(_rectangle(-aside, -up, aside, up), lean), strokes


def _draw_plus(random: np.random.Generator, reach: float) -> tuple[Canvas, npt.NDArray[np.float64]]:
    """A cross, upright or lying as an X, like `_draw_letter`."""
    half = reach * random.uniform(0.12, 0.4)
    turn = math.pi / 4 * (random.random() < 0.4)
    c, s = math.cos(turn), math.sin(turn)
    mask = np.zeros((SIDE, SIDE), np.uint8)
    bars = [_rectangle(-x, -y, x, y) for x, y in ((reach, half), (half, reach))]
    bars = [bar @ np.array([[c, s], [-s, c]]) for bar in bars]
    for bar in bars:
        _fill(mask, bar, (255,))
    side = float(np.abs(bars).max())
    return mask, _rectangle(-side, -side, side, side), tuple(bars)


def _rectangle(x0: float, y0: float, x1: float, y1: float) -> npt.NDArray[np.float64]:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _flared(stem: npt.NDArray[np.float64], wider: float) -> npt.NDArray[np.float64]:
    """A stem that becomes wider towards both ends, on each side by so much."""
    (x0, y0), (x1, y1) = stem[0], stem[2]
    right = [(x1 + wider, y0), (x1, 0.4 * y0), (x1, 0.4 * y1), (x1 + wider, y1)]
    left = [(x0 - wider, y1), (x0, 0.4 * y1), (x0, 0.4 * y0), (x0 - wider, y0)]
    return np.array(right + left)


def _leant(shape: npt.NDArray[np.float64], lean: float) -> npt.NDArray[np.float64]:
    """Its upper parts further to the right, as in italics."""
    return shape @ np.array([[1.0, 0.0], [lean, 1.0]])


def _widened(mask: Canvas, edge: float) -> Canvas:
    """Points no further from the mask than ``edge`` half sides."""
    side = 2 * round(edge * SIDE / 2) + 1
    return np.asarray(cv2.dilate(mask, np.ones((side, side), np.uint8)), np.uint8)


def _decorate(
    random: np.random.Generator, canvas: Canvas, radius: float, reach: float, ink: tuple[int, ...]
) -> None:
    """Stars, dots or arrows around the letter, or a number beside it."""
    if random.random() < 0.55:
        return
    count, kind = int(random.choice([1, 2, 4, 4, 8])), int(random.integers(4))
    middle, size = (radius * 0.82 + reach) / 2, random.uniform(0.05, 0.11) * radius
    for number in range(count):
        angle = 2 * math.pi * number / count + math.pi / 2
        at = middle * np.array([math.cos(angle), math.sin(angle)])
        if kind == 3:
            spot = (round((1 + at[0]) * SIDE / 2), round((1 - at[1]) * SIDE / 2))
            text, scale = str(random.integers(1, 99)), 6 * size
            cv2.putText(canvas, text, spot, cv2.FONT_HERSHEY_DUPLEX, scale, ink, 2, cv2.LINE_AA)
            return
        spikes = (10, 24, 3)[kind]
        turns = angle + 2 * math.pi * np.arange(spikes) / spikes
        far = np.where(np.arange(spikes) % 2, 0.42, 1.0) if kind == 0 else np.ones(spikes)
        star = np.stack([np.cos(turns), np.sin(turns)], axis=1) * (size * far)[:, None]
        _fill(canvas, at + star, ink)


def _wear(random: np.random.Generator, paint: Canvas, under: Canvas) -> Canvas:
    """Let the ground show where paint is worn off, and stain the rest."""
    if random.random() < 0.35:
        return paint
    cells = int(random.integers(4, 60))
    worn = smooth_noise(random, SIDE, cells) + 0.7 * smooth_noise(random, SIDE, 3 * cells)
    share = np.clip((worn - random.uniform(0.4, 1.2)) * 4, 0, random.uniform(0.3, 0.9))
    stain = 1 + random.uniform(0, 0.25) * smooth_noise(random, SIDE, int(random.integers(2, 12)))
    mixed = paint + (under.astype(np.float32) - paint) * share[..., None]
    return np.asarray(np.clip(mixed * stain[..., None], 0, 255), np.uint8)


def to_pixels(shape: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
    """Half sides, y up, as cv2's fixed point of 4 bits; a pixel's centre is at .5."""
    uv = (np.array([1.0, -1.0]) * shape + 1) * SIDE / 2 - 0.5
    return np.asarray(np.round(uv * _ONE), np.int32)


def _fill(canvas: Canvas, shape: npt.NDArray[np.float64], ink: tuple[int, ...]) -> None:
    cv2.fillPoly(canvas, [to_pixels(shape)], ink, cv2.LINE_AA, 4)


def _ring(
    canvas: Canvas, shape: npt.NDArray[np.float64], stroke: float, ink: tuple[int, ...]
) -> None:
    """A closed line ``stroke`` wide, inside of the shape."""
    far = np.linalg.norm(shape, axis=1).max()
    mask = np.zeros(canvas.shape[:2], np.uint8)
    _fill(mask, shape, (255,))
    _fill(mask, shape * (1 - stroke / far), (0,))
    _stamp(canvas, mask, ink)


def _stamp(canvas: Canvas, mask: Canvas, ink: tuple[int, ...]) -> None:
    share = (mask.astype(np.float32) / 255)[..., None]
    canvas[:] = canvas + (np.array(ink, np.float32) - canvas) * share


def _dash(
    random: np.random.Generator,
    canvas: Canvas,
    shape: npt.NDArray[np.float64],
    stroke: float,
    ink: tuple[int, ...],
) -> None:
    """A broken line along the shape."""
    count = int(random.integers(16, 60)) * 2
    closed = np.vstack([shape, shape[:1]])
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.linspace(0, along[-1], count + 1)
    points = np.stack([np.interp(at, along, closed[:, axis]) for axis in (0, 1)], axis=1)
    uv, wide = to_pixels(points), max(1, round(stroke * SIDE / 2))
    for start in range(0, count, 2):
        ends = [tuple(map(int, uv[start + step])) for step in (0, 1)]
        cv2.line(canvas, ends[0], ends[1], ink, wide, cv2.LINE_AA, 4)
