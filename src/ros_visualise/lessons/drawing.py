"""What the figures of lessons have in common."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.sinks.axes import Axes
from ros_visualise.sinks.figure import Box, Color, Figure

WIDTH = 480
"""Of figures with texts: in a window of some 300 pixels they can be read."""

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


def draw_histogram(figure: Figure, box: Box, pixels: Pixels, color: Color = GRAY) -> Axes:
    """How many pixels have each of 256 levels, as bars; returns the axes."""
    counts = np.bincount(pixels.ravel(), minlength=256)
    axes = Axes(figure, box, np.zeros(2), np.array([255.0, counts.max()]))
    axes.draw("level", "pixels")
    edges = np.repeat(np.arange(257) - 0.5, 2)
    heights = np.concatenate([[0], np.repeat(counts, 2), [0]])
    figure.area(axes.places(np.stack([edges, heights], axis=1)), color)
    return axes


def draw_level(axes: Axes, level: float, top: float, color: Color, foot: float = 0.0) -> None:
    """A vertical line at a level."""
    axes.curve(np.array([[level, foot], [level, top]]), color, 2)


def titled(pictures: Sequence[tuple[str, Pixels]], columns: int, width: int = WIDTH) -> Figure:
    """Pictures of one size in a grid, each below its title."""
    height, across = pictures[0][1].shape[:2]
    cell = width / columns
    shown = cell - 8
    row = shown * height / across + 26
    figure = Figure(width, round(row * -(-len(pictures) // columns)))
    for number, (title, picture) in enumerate(pictures):
        left, top = (number % columns) * cell + 4, (number // columns) * row
        figure.text(left, top + 17, title, 13)
        figure.picture((left, top + 22, shown, row - 26), picture, (0, 0))
    return figure
