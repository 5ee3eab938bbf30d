"""What the figures of lessons have in common."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.sinks.axes import Axes
from ros_visualise.sinks.figure import Box, Color, Figure

INK: Color = (40, 40, 40)
BLUE: Color = (31, 111, 178)
RED: Color = (200, 50, 40)
GREEN: Color = (44, 145, 60)
ORANGE: Color = (230, 140, 20)
YELLOW: Color = (255, 220, 0)
GRAY: Color = (150, 150, 150)


def levels(values: Floats | Pixels, top: float | None = None) -> Pixels:
    """Values from 0 to the top, by default the largest, as 8 bits."""
    largest = float(values.max() if top is None else top) or 1.0
    scaled: Pixels = np.clip(values * (255.0 / largest), 0, 255).astype(np.uint8)
    return scaled


def by_direction(angle: Floats, strength: Floats | Pixels) -> Pixels:
    """BGR: the direction in degrees as hue, the strength's root as brightness."""
    hue = (angle / 2).astype(np.uint8) % 180
    return cv2.cvtColor(
        cv2.merge([hue, np.full_like(hue, 255), levels(np.sqrt(strength))]), cv2.COLOR_HSV2BGR
    )


def frame(figure: Figure, box: Box, color: Color, width: float = 1.5) -> None:
    """The outline of a rectangle."""
    left, top, right, bottom = box[0], box[1], box[0] + box[2], box[1] + box[3]
    corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
    figure.line(np.array(corners), color, width)


def arrow(figure: Figure, start: Floats, end: Floats, color: Color, width: float = 2.5) -> None:
    """A line with a head; points (2,)."""
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    aside = np.array([-along[1], along[0]])
    head = 4 * width
    figure.line(np.array([start, end - head * along / 2]), color, width)
    figure.area(
        np.array([end, *(end - head * along + s * aside * head / 2 for s in (1, -1))]), color
    )


class Zoom:
    """The pixels around one, enlarged, each with its number.

    Args:
        figure: what is drawn on.
        box: where; a square.
        center: (x, y) of the pixel.
        reach: how many pixels are shown on each side of it.
    """

    def __init__(self, figure: Figure, box: Box, center: tuple[int, int], reach: int) -> None:
        self._figure, self._box = figure, box
        self._center, self._reach = center, reach
        self._side = box[2] / (2 * reach + 1)

    def draw(self, picture: Pixels, numbers: Floats | Pixels | None = None) -> None:
        """A picture, and the numbers (height, width) of its pixels where they are given."""
        x, y = self._center
        n = self._reach
        wide = cv2.copyMakeBorder(picture, n, n, n, n, cv2.BORDER_CONSTANT)
        patch = wide[y : y + 2 * n + 1, x : x + 2 * n + 1]
        self._figure.picture(self._box, np.ascontiguousarray(patch))
        if numbers is None:
            return
        luma = patch if patch.ndim == 2 else cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY)
        height, width = picture.shape[:2]
        for row in range(max(0, y - n), min(height, y + n + 1)):
            for column in range(max(0, x - n), min(width, x + n + 1)):
                is_bright = luma[row - y + n, column - x + n] > 110
                ink = (0, 0, 0) if is_bright else (255, 255, 255)
                place = self.place(column, row)
                text = f"{numbers[row, column]:.0f}"
                size = min(13.0, 1.5 * self._side / len(text))
                self._figure.text(place[0], place[1] + size / 3, text, size, "middle", ink)

    def mark(self, x: int, y: int, color: Color) -> None:
        """The outline of a pixel."""
        left, top = self.place(x, y) - self._side / 2
        frame(self._figure, (left, top, self._side, self._side), color, 3)

    def place(self, x: float, y: float) -> Floats:
        """Where the middle of a pixel is on the figure, (2,)."""
        from_center = np.array([x - self._center[0], y - self._center[1]]) + self._reach + 0.5
        return np.array(self._box[:2]) + from_center * self._side


def draw_histogram(figure: Figure, box: Box, pixels: Pixels, color: Color = GRAY) -> Axes:
    """How many pixels have each of 256 levels, as bars; returns the axes."""
    counts = np.bincount(pixels.ravel(), minlength=256)
    axes = Axes(figure, box, np.zeros(2), np.array([255.0, counts.max()]))
    axes.draw("level", "pixels")
    edges = np.repeat(np.arange(257) - 0.5, 2)
    heights = np.concatenate([[0], np.repeat(counts, 2), [0]])
    figure.area(axes.places(np.stack([edges, heights], axis=1)), color)
    return axes


def draw_level(axes: Axes, level: float, top: float, color: Color) -> None:
    """A vertical line at a level."""
    axes.curve(np.array([[level, 0.0], [level, top]]), color, 2)


def titled(pictures: Sequence[tuple[str, Pixels]], columns: int, width: int = 640) -> Figure:
    """Pictures of one size in a grid, each below its title."""
    height, across = pictures[0][1].shape[:2]
    cell = width / columns
    shown = cell - 8
    row = shown * height / across + 26
    figure = Figure(width, round(row * -(-len(pictures) // columns)))
    for number, (title, picture) in enumerate(pictures):
        left, top = (number % columns) * cell + 4, (number // columns) * row
        figure.text(left, top + 17, title, 13)
        figure.picture((left, top + 22, shown, row - 26), picture)
    return figure


def pixel_of(shape: tuple[int, ...], x: int, y: int, otherwise: tuple[int, int]) -> tuple[int, int]:
    """(x, y) of the pixel that a person chose, or another one if either is below zero."""
    if x < 0 or y < 0:
        return otherwise
    return min(x, shape[1] - 1), min(y, shape[0] - 1)
