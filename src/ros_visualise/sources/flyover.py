"""A drone's flight along the road of a drawn valley: images that need no file and no simulator."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from functools import cache, partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Deferred, Image, Pixels
from ros_visualise.sources.video_pixels import Size

FPS = 30
LENGTH_S = 60
_VIEW_PX = 640  # width of the view on the map, at zoom 1
_BITS = 4  # after the binary point, in what OpenCV draws
_LANE_PX = 9.5
_MARGIN_PX = 200  # a car of a 4K image is that long
_CARS = (  # place on the road at time zero, laps while the flight lasts (negative: against it), BGR
    (0.02, 3, (52, 44, 196)),
    (0.10, 2, (226, 226, 222)),
    (0.22, -2, (186, 112, 48)),
    (0.31, 3, (44, 176, 232)),
    (0.43, -3, (70, 70, 72)),
    (0.52, 2, (60, 140, 64)),
    (0.60, -2, (210, 214, 216)),
    (0.68, 3, (34, 100, 214)),
    (0.79, -3, (150, 60, 110)),
    (0.90, -2, (48, 48, 160)),
)
_CAR = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (13.0, 6.5)
Canvas = npt.NDArray[np.uint8]
Points = npt.NDArray[np.float64]
SIDE = 2560
"""Width and height of the map, in pixels."""
_SHADOW = (6, 8)  # where the sun throws it
_FIELDS = (  # BGR
    (88, 158, 122),
    (70, 138, 98),
    (96, 176, 150),
    (110, 190, 196),
    (120, 182, 214),
    (92, 132, 164),
    (80, 150, 84),
    (104, 168, 132),
)
_HEDGE = (52, 92, 58)
_ROOFS = ((70, 92, 176), (64, 78, 148), (92, 104, 122), (84, 112, 188), (110, 112, 118))


class Flyover:
    """The images of the flight; each depends on its time alone, and the last leads to the first."""

    duration_ns = LENGTH_S * 10**9

    def __init__(self, size: Size = (640, 480)) -> None:
        self._size = size
        self._landscape: Any = draw_landscape()  # takes a second, which no image is to wait for

    def read(self, start_ns: int = 0) -> Generator[tuple[int, Image], None, None]:
        """(Time, image), from the image shown at ``start_ns`` on."""
        last = FPS * LENGTH_S - 1
        for index in range(min(start_ns * FPS // 10**9, last), last + 1):
            shape = (self._size[1], self._size[0], 3)
            pixels = Deferred(shape, np.uint8, partial(self.render, index / FPS))
            yield -(-index * 10**9 // FPS), Image(pixels, "bgr8")

    def render(self, time_s: float) -> Pixels:
        """The view at a time, in BGR."""
        view = self._view(time_s)
        pixels: Any = cv2.warpAffine(
            self._landscape,
            view,
            self._size,
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT_101,
        )
        for place, laps, colour in _CARS:
            _draw_car(pixels, view, place + laps * time_s / LENGTH_S, np.sign(laps), colour)
        rendered: Pixels = pixels
        return rendered

    def _view(self, time_s: float) -> npt.NDArray[np.float64]:
        """From map to image, 2x3: heading up, swaying a little."""
        turn = 2 * np.pi * time_s / LENGTH_S
        position, along = _on_road(time_s / LENGTH_S)
        inwards = np.array([SIDE / 2, SIDE / 2]) - position
        centre = position + inwards * (0.10 + 0.07 * np.sin(3 * turn))
        heading = np.arctan2(along[1], along[0]) + 0.12 * np.sin(4 * turn) + np.pi / 2
        zoom = self._size[0] / _VIEW_PX * (1.0 + 0.16 * np.sin(2 * turn))
        cos, sin = zoom * np.cos(heading), zoom * np.sin(heading)
        linear = np.array([[cos, sin], [-sin, cos]])
        shift = np.array(self._size) / 2 - linear @ centre
        return np.column_stack([linear, shift])


@cache
def _road() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """The closed road, and the share of its length at each of its points."""
    points = np.concatenate([road(), road()[:1]])
    length = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return points, length / length[-1]


def _on_road(phase: float) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Position and direction (of length 1) at a share of the road's length."""
    points, shares = _road()
    phases = [phase % 1, (phase + 0.004) % 1]
    x, y = (np.interp(phases, shares, points[:, axis]) for axis in (0, 1))
    along = np.array([x[1] - x[0], y[1] - y[0]])
    return np.array([x[0], y[0]]), along / np.hypot(*along)


def _draw_car(pixels: Any, view: Any, phase: float, lane: float, colour: Any) -> None:
    position, along = _on_road(phase)
    seen = view[:, :2] @ position + view[:, 2]
    if np.any(seen < -_MARGIN_PX) or np.any(seen > np.array(pixels.shape[1::-1]) + _MARGIN_PX):
        return
    turn = np.array([along, [-along[1], along[0]]]) * lane
    centre = position + turn[1] * _LANE_PX

    def draw(outline: Any, bgr: Any, offset: Any = (0, 0)) -> None:
        on_map = outline @ turn + centre + offset
        on_image = on_map @ view[:, :2].T + view[:, 2]
        _fill(pixels, on_image, bgr)

    draw(_CAR, (62, 60, 58), (4, 5))
    draw(_CAR, colour)
    draw(_CAR * (0.5, 0.82) + (-1.5, 0), tuple(0.55 * c for c in colour))
    draw(_CAR * (0.34, 0.72) + (-1.8, 0), colour)


def road() -> Points:
    """The middle of the road: a closed curve through the valley, (N, 2), its first point once."""
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    radius = 690 * (1 + 0.09 * np.sin(3 * angle + 0.7) + 0.05 * np.sin(5 * angle))
    return SIDE / 2 + np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


@cache
def draw_landscape() -> Pixels:
    """The map, (SIDE, SIDE, 3) in BGR; always the same."""
    random = np.random.default_rng(7)
    canvas = _draw_fields(random)
    _draw_river(canvas, random)
    taken = _draw_road(canvas)
    _draw_helipad(canvas, (SIDE // 2 + 420, SIDE // 2 - 310), taken)
    _draw_houses(canvas, random, taken)
    _draw_trees(canvas, random, taken)
    return _add_grain(canvas, random)


def _draw_fields(random: np.random.Generator) -> Canvas:
    """Parcels of a warped grid, each of one crop with its rows, and hedges between them.

    They are drawn at half the size, which is soft enough for plants and four times as fast.
    """
    x = np.arange(0, SIDE, 2, dtype=np.float32)
    y = x[:, None]
    bend = 60 * _noise(random, 5)
    across, along = 0.94 * x + 0.34 * y + bend, 0.94 * y - 0.34 * x + bend
    column, row = np.floor(across / 330), np.floor(along / 240)
    kind = ((column * 7 + row * 13 + np.fmod(abs(column * row), 5)) % len(_FIELDS)).astype(np.uint8)
    crops = np.sin(np.where(kind % 2, across, along) * (0.45 + 0.08 * (kind % 3)))
    shade = 1 + 0.045 * crops + 0.13 * _noise(random, 9) + 0.07 * _noise(random, 80)
    fields = np.array(_FIELDS, np.uint8)[kind]
    canvas = cv2.multiply(fields, cv2.merge([shade.astype(np.float32)] * 3), dtype=cv2.CV_8U)
    from_column = abs(across - (column + 0.5) * 330)
    from_row = abs(along - (row + 0.5) * 240)
    rim = np.maximum(from_column - 165, from_row - 120)
    canvas[rim > -3 - 2 * _noise(random, 120)] = _HEDGE
    return np.asarray(cv2.resize(canvas, (SIDE, SIDE), interpolation=cv2.INTER_LINEAR), np.uint8)


def _draw_river(canvas: Canvas, random: np.random.Generator) -> None:
    x = np.linspace(-100, SIDE + 100, 160)
    y = SIDE / 2 + 190 * np.sin(x / 330) + 120 * np.sin(x / 170 + 1) + (x - SIDE / 2) * 0.35
    line = np.stack([x, y], axis=1)
    for colour, width in (
        ((96, 146, 128), 128),
        ((150, 190, 200), 112),
        ((150, 128, 74), 98),
        ((166, 140, 78), 80),
        ((178, 152, 88), 46),
    ):
        _draw(canvas, line, colour, width)
    for _ in range(420):
        at = random.integers(0, len(x) - 1)
        cx, cy = x[at] + random.normal(0, 8), y[at] + random.normal(0, 17)
        half = random.uniform(4, 12)
        ripple = np.array([[cx - half, cy], [cx, cy - 1.5], [cx + half, cy]])
        _draw(canvas, ripple, (200, 178, 122), 1)


def _draw_road(canvas: Canvas) -> Canvas:
    """Draws it; returns the mask of where nothing may be built."""
    points = road()
    for colour, width in (((120, 160, 160), 54), ((222, 228, 230), 42), ((92, 88, 86), 38)):
        _draw(canvas, points, colour, width, closed=True)
    for start in range(0, len(points), 6):
        _draw(canvas, points[start : start + 4], (232, 236, 238), 3)
    water = cv2.inRange(canvas, np.array((145, 120, 70)), np.array((205, 185, 125)))
    taken = cv2.dilate(water, np.ones((25, 25), np.uint8))
    cv2.polylines(taken, [_fixed(points)], True, 255, 74, cv2.LINE_8, _BITS)
    return np.asarray(taken, np.uint8)


def _draw_helipad(canvas: Canvas, centre: tuple[int, int], taken: Canvas) -> None:
    x, y = centre
    cv2.circle(canvas, centre, 64, (150, 152, 152), -1, cv2.LINE_AA)
    cv2.circle(canvas, centre, 60, (104, 102, 100), -1, cv2.LINE_AA)
    cv2.circle(canvas, centre, 50, (240, 240, 240), 5, cv2.LINE_AA)
    for start, end in (((-18, -26), (-18, 26)), ((18, -26), (18, 26)), ((-18, 0), (18, 0))):
        ends = (x + start[0], y + start[1]), (x + end[0], y + end[1])
        cv2.line(canvas, *ends, (240, 240, 240), 9, cv2.LINE_AA)
    for angle in range(0, 360, 45):
        at = round(x + 60 * np.cos(np.radians(angle))), round(y + 60 * np.sin(np.radians(angle)))
        cv2.circle(canvas, at, 4, (60, 200, 250), -1, cv2.LINE_AA)
    cv2.circle(taken, centre, 80, 255, -1)


def _draw_houses(canvas: Canvas, random: np.random.Generator, taken: Canvas) -> None:
    """Houses along the road, their ridges more or less parallel to it."""
    points = road()
    for _ in range(260):
        at = int(random.integers(len(points)))
        along = points[(at + 1) % len(points)] - points[at - 1]
        along /= np.hypot(*along)
        aside = np.array([-along[1], along[0]]) * random.choice([-1, 1])
        centre = points[at] + aside * random.uniform(72, 190)
        if _claim(taken, centre, 44):
            _draw_house(canvas, random, centre, np.arctan2(along[1], along[0]))


def _draw_house(canvas: Canvas, random: np.random.Generator, centre: Points, angle: float) -> None:
    length, width = random.uniform(24, 38), random.uniform(15, 21)
    angle += random.normal(0, 0.12)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def corners(*xy: tuple[float, float]) -> Any:
        return np.array(xy) * (length, width) @ turn + centre

    outline = corners((-1, -1), (1, -1), (1, 1), (-1, 1))
    _fill(canvas, (outline - centre) * 1.7 + centre, (98, 168, 120))
    _shade(canvas, outline + np.array(_SHADOW) * 1.6)
    roof = np.array(_ROOFS[random.integers(len(_ROOFS))])
    sides = corners((-1, -1), (1, -1), (1, 0), (-1, 0)), corners((-1, 0), (1, 0), (1, 1), (-1, 1))
    lit = int(np.cos(angle) < 0)  # the sun stands at the top of the map
    for side, light in zip(sides, (1.22, 0.84) if not lit else (0.84, 1.22), strict=True):
        _fill(canvas, side, np.clip(roof * light, 0, 255))
    _draw(canvas, corners((-1, 0), (1, 0)), (200, 206, 214), 1)
    chimney = corners((0.4, 0.25), (0.6, 0.25), (0.6, 0.55), (0.4, 0.55))
    _fill(canvas, chimney, (70, 70, 84))


def _draw_trees(canvas: Canvas, random: np.random.Generator, taken: Canvas) -> None:
    """Woods and single trees."""
    woods = random.uniform(0, SIDE, (22, 2))
    near = woods[random.integers(len(woods), size=1100)] + random.normal(0, 62, (1100, 2))
    for centre in np.concatenate([near, random.uniform(0, SIDE, (320, 2))]):
        radius = random.uniform(9, 19)
        if _claim(taken, centre, radius * 0.75):
            _draw_tree(canvas, random, centre, radius)


def _draw_tree(canvas: Canvas, random: np.random.Generator, centre: Points, radius: float) -> None:
    angle = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    crown = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    crown *= radius * random.uniform(0.86, 1.1, (14, 1))
    _shade(canvas, crown + centre + _SHADOW)
    green = np.array((48, 96, 54)) + random.integers(-12, 22, 3)
    for shrink, light in ((1.0, 0.78), (0.74, 1.05), (0.38, 1.36)):
        leaves = crown * shrink + centre - np.array(_SHADOW) * (1 - shrink) * 0.5
        _fill(canvas, leaves, green * light)


def _claim(taken: Canvas, centre: Points, radius: float) -> bool:
    """True if a place on the map is free; it is taken from then on."""
    x, y, r = int(centre[0]), int(centre[1]), int(radius)
    place = taken[max(0, y - r) : y + r, max(0, x - r) : x + r]
    if cv2.countNonZero(place):
        return False
    place[:] = 255
    return True


def _shade(canvas: Canvas, outline: Points) -> None:
    """A soft shadow of that outline."""
    low = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 2, 0)
    high = np.ceil(outline.max(axis=0)).astype(int) + 3
    part = canvas[low[1] : high[1], low[0] : high[0]]
    if part.size:
        dark = np.full(part.shape[:2], 255, np.uint8)
        _fill(dark, outline - low, (130,))
        part[:] = cv2.multiply(part, cv2.merge([dark] * 3), scale=1 / 255)


def _add_grain(canvas: Canvas, random: np.random.Generator) -> Pixels:
    grain = random.integers(0, 15, (SIDE // 2, SIDE // 2), np.uint8)
    grain = cv2.resize(grain, (SIDE, SIDE), interpolation=cv2.INTER_LINEAR)
    return cv2.subtract(cv2.add(canvas, cv2.merge([grain] * 3)), np.full(4, 7.0))


def _noise(random: np.random.Generator, cells: int) -> npt.NDArray[np.float32]:
    """Smooth noise between about -1 and 1, with that many cells over a map of half the size."""
    values = random.uniform(-1, 1, (cells, cells)).astype(np.float32)
    half = (SIDE // 2, SIDE // 2)
    return np.asarray(cv2.resize(values, half, interpolation=cv2.INTER_CUBIC), np.float32)


def _fixed(points: Points) -> npt.NDArray[np.int32]:
    """Points for OpenCV."""
    return np.asarray(np.round(points * 2**_BITS), np.int32)


def _fill(canvas: Any, outline: Points, colour: Iterable[float]) -> None:
    cv2.fillPoly(canvas, [_fixed(outline)], tuple(map(float, colour)), cv2.LINE_AA, _BITS)


def _draw(
    canvas: Canvas, line: Points, colour: tuple[int, ...], width: int, closed: bool = False
) -> None:
    cv2.polylines(canvas, [_fixed(line)], closed, colour, width, cv2.LINE_AA, _BITS)
