"""A drone's flight along the road of a drawn valley: images that need no file and no simulator."""

from __future__ import annotations

from collections.abc import Generator
from functools import cache, partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Deferred, Image, Pixels
from ros_visualise.sources.landscape import SIDE, draw_landscape, road
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


class Flyover:
    """The images of the flight; each depends on its time alone, and the last leads to the first.

    Args:
        size: (width, height) of the images.
    """

    duration_ns = LENGTH_S * 10**9

    def __init__(self, size: Size = (640, 480)) -> None:
        self._size = size
        self._landscape: Any = _landscape()  # takes a second, which no image is to wait for

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
def _landscape() -> Pixels:
    return draw_landscape()


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
        corners = np.round(on_image * 2**_BITS).astype(np.int32)
        cv2.fillPoly(pixels, [corners], bgr, cv2.LINE_AA, _BITS)

    draw(_CAR, (62, 60, 58), (4, 5))
    draw(_CAR, colour)
    draw(_CAR * (0.5, 0.82) + (-1.5, 0), tuple(0.55 * c for c in colour))
    draw(_CAR * (0.34, 0.72) + (-1.8, 0), colour)
