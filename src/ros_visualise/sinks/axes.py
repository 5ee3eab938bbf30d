"""Axes with marks at round numbers, in which a figure shows curves."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry.thinning import thin
from ros_visualise.sinks.figure import Color, Figure

_GRID: Color = (225, 225, 225)
_FRAME: Color = (120, 120, 120)
_SPACING = (90, 50)  # of the grid's lines, about
_MOST_POINTS = 3000
"""Points of a curve; more are thinned, which no eye sees at this size."""


class Axes:
    """A rectangle of a figure, and what part of the plane it shows.

    Args:
        figure: what is drawn on.
        box: left, top, width, height.
        low, high: (2,) each, the least and the greatest numbers to show, right and up.
        equal: both directions have one scale.
    """

    def __init__(
        self,
        figure: Figure,
        box: tuple[float, float, float, float],
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
        """The frame, a grid at round numbers, and the names of the two directions."""
        left, top, width, height = self._box
        for axis in (0, 1):
            high = self._low[axis] + self._box[2 + axis] / self._scale[axis]
            about = self._box[2 + axis] / _SPACING[axis]
            for number, text in marks(float(self._low[axis]), float(high), about):
                self._mark(axis, number, text)
        right, bottom = left + width, top + height
        corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]]
        self._figure.line(np.array(corners), _FRAME, 1)
        self._figure.text(right, bottom + 34, across, anchor="end")
        self._figure.text(left, top - 8, up)

    def curve(self, points: Floats, color: Color, width: float = 1.8) -> None:
        """A line through points (N, 2)."""
        places = self.places(points)
        if len(places) > 1:
            kept, _ = thin(places, np.zeros(len(places) - 1), _MOST_POINTS)
            self._figure.line(places[kept], color, width)

    def places(self, points: Floats) -> Floats:
        """Where on the figure points (N, 2) are."""
        left, top, _, height = self._box
        shown = (points - self._low) * self._scale
        return np.stack([left + shown[:, 0], top + height - shown[:, 1]], axis=1)

    def _mark(self, axis: int, number: float, text: str) -> None:
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


def marks(low: float, high: float, about: float) -> list[tuple[float, str]]:
    """Round numbers from low to high and how to write them, some ``about`` of them; two, if so
    few are round."""
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
