"""The axes of a plot: a grid with ticks at round numbers, and curves in it."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.geometry.thinning import simplify
from ros_visualise.plotting.colors import GRAY, Color
from ros_visualise.plotting.figure import Box, Figure

_GRID: Color = (225, 225, 225)
_FRAME: Color = (120, 120, 120)
_SPACING = (90, 50)  # of the grid's lines, about
_MOST_POINTS = 3000
"""Points of a curve; more are thinned, which is invisible at this size."""


class PlotAxes:
    """A rectangle of a figure that shows a part of the plane.

    Args:
        figure: the figure to draw on.
        box: the rectangle.
        low, high: (2,) each, the least and the greatest numbers to show, right and up.
        equal: both directions have one scale.
    """

    def __init__(
        self,
        figure: Figure,
        box: Box,
        low: Floats,
        high: Floats,
        equal: bool = False,
    ) -> None:
        self._figure = figure
        self._box = box
        size = np.array(box[2:])
        span = np.maximum((high - low) * 1.06, 1e-9 + np.abs(high) * 1e-9)
        span = np.where(high - low > 0, span, np.where(equal, span.max(), 1.0))
        scale = size / span
        self._scale = np.full(2, scale.min()) if equal else scale
        self._low = (low + high) / 2 - size / self._scale / 2

    def draw(self, across: str, up: str) -> None:
        """Draw the frame, a grid at round numbers, and the names of the two directions."""
        left, top, width, height = self._box
        for axis in (0, 1):
            high = self._low[axis] + self._box[2 + axis] / self._scale[axis]
            about = self._box[2 + axis] / _SPACING[axis]
            for number, text in ticks(float(self._low[axis]), float(high), about):
                self._draw_tick(axis, number, text)
        self._figure.outline(self._box, _FRAME, 1)
        self._figure.text(left + width, top + height + 34, across, anchor="end")
        self._figure.text(left, top - 8, up)

    def curve(self, points: Floats, color: Color, width: float = 1.8) -> None:
        """Draw a line through points (N, 2)."""
        places = self.places(points)
        if len(places) > 1:
            kept, _ = simplify(places, np.zeros(len(places) - 1), _MOST_POINTS)
            self._figure.line(places[kept], color, width)

    def vertical(self, at: float, top: float, color: Color, foot: float = 0.0) -> None:
        """Draw a vertical line."""
        self.curve(np.array([[at, foot], [at, top]]), color, 2)

    def places(self, points: Floats) -> Floats:
        """Places on the figure of points (N, 2)."""
        left, top, _, height = self._box
        shown = (points - self._low) * self._scale
        return np.stack([left + shown[:, 0], top + height - shown[:, 1]], axis=1)

    def _draw_tick(self, axis: int, number: float, text: str) -> None:
        left, top, width, height = self._box
        at = np.array([self._low])
        at[0, axis] = number
        x, y = self.places(at)[0]
        if axis == 0:
            self._figure.line(np.array([[x, top], [x, top + height]]), _GRID, 1)
            self._figure.text(x, top + height + 16, text, 11, "middle")
        else:
            self._figure.line(np.array([[left, y], [left + width, y]]), _GRID, 1)
            self._figure.text(left - 6, y + 4, text, 11, "end")


def draw_histogram(figure: Figure, box: Box, pixels: Pixels) -> PlotAxes:
    """Draw how many pixels have each of 256 levels; returns the axes."""
    counts = np.bincount(pixels.ravel(), minlength=256)
    axes = PlotAxes(figure, box, np.zeros(2), np.array([255.0, counts.max()]))
    axes.draw("level", "pixels")
    edges = np.repeat(np.arange(257) - 0.5, 2)
    heights = np.concatenate([[0], np.repeat(counts, 2), [0]])
    figure.area(axes.places(np.stack([edges, heights], axis=1)), GRAY)
    return axes


def ticks(low: float, high: float, about: float) -> list[tuple[float, str]]:
    """Round numbers from low to high and how to write them: ``about`` so many, at least two if
    possible."""
    rough = (high - low) / about
    power = 10.0 ** math.floor(math.log10(rough))
    steps = [factor * power for factor in (0.5, 1, 2, 5, 10)]
    chosen = next(number for number, step in enumerate(steps) if step >= rough)
    found = _multiples(low, high, steps[chosen])
    return found if len(found) > 1 else _multiples(low, high, steps[chosen - 1])


def _multiples(low: float, high: float, step: float) -> list[tuple[float, str]]:
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    numbers = range(math.ceil(low / step), math.floor(high / step) + 1)
    return [(number * step, f"{number * step:.{digits}f}") for number in numbers]
