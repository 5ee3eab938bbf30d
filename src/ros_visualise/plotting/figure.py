"""Figures of lines, areas, pictures, dots and texts, saved as SVG, PNG or PDF."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.plotting.colors import Color, css
from ros_visualise.plotting.pdf import PdfPage

_PNG_SCALE = 2
_GRID_WIDTH = 480
_SHIFT = 4  # bits of a pixel's fraction in OpenCV's drawing

Box = tuple[float, float, float, float]
"""Left, top, width, height."""


@dataclass(frozen=True)
class _Line:
    points: Floats
    color: Color
    width: float

    def svg(self) -> str:
        stroke = f'stroke="{css(self.color)}" stroke-width="{self.width:g}"'
        style = f'fill="none" {stroke} stroke-linejoin="round"'
        return f'<polyline points="{_pairs(self.points)}" {style}/>'

    def print(self, page: PdfPage) -> None:
        page.line(self.points, self.color, self.width)

    def paint(self, pixels: Pixels) -> None:
        width = max(1, round(self.width * _PNG_SCALE))
        points = [_fixed(self.points)]
        cv2.polylines(pixels, points, False, self.color[::-1], width, cv2.LINE_AA, _SHIFT)


@dataclass(frozen=True)
class _Area:
    points: Floats
    color: Color

    def svg(self) -> str:
        return f'<polygon points="{_pairs(self.points)}" fill="{css(self.color)}"/>'

    def print(self, page: PdfPage) -> None:
        page.area(self.points, self.color)

    def paint(self, pixels: Pixels) -> None:
        cv2.fillPoly(pixels, [_fixed(self.points)], self.color[::-1], cv2.LINE_AA, _SHIFT)


@dataclass(frozen=True)
class _Picture:
    box: Box
    pixels: Pixels
    corner: tuple[int, int] | None

    def svg(self) -> str:
        left, top, width, height = self.box
        place = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
        style = 'preserveAspectRatio="none" style="image-rendering: pixelated"'
        data = b64encode(_png(self.pixels)).decode()
        return f'<image {place} {style} href="data:image/png;base64,{data}"/>'

    def print(self, page: PdfPage) -> None:
        page.picture(self.box, self.pixels)

    def paint(self, pixels: Pixels) -> None:
        left, top, width, height = (round(number * _PNG_SCALE) for number in self.box)
        is_larger = self.pixels.shape[1] < width
        how = cv2.INTER_NEAREST if is_larger else cv2.INTER_AREA
        scaled = cv2.resize(self.pixels, (width, height), interpolation=how)
        colors = cv2.cvtColor(scaled, cv2.COLOR_GRAY2BGR) if scaled.ndim == 2 else scaled
        place = pixels[top : top + height, left : left + width]
        place[:] = colors[: place.shape[0], : place.shape[1]]

    def pixel_at(self, x: float, y: float) -> tuple[int, int] | None:
        if self.corner is None:
            return None
        height, width = self.pixels.shape[:2]
        column = math.floor((x - self.box[0]) * width / self.box[2])
        row = math.floor((y - self.box[1]) * height / self.box[3])
        if not (0 <= column < width and 0 <= row < height):
            return None
        return self.corner[0] + column, self.corner[1] + row


@dataclass(frozen=True)
class _Dot:
    center: Floats
    radius: float
    color: Color

    def svg(self) -> str:
        x, y = self.center
        return f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{self.radius:g}" fill="{css(self.color)}"/>'

    def print(self, page: PdfPage) -> None:
        page.dot(self.center, self.radius, self.color)

    def paint(self, pixels: Pixels) -> None:
        center, radius = _fixed(self.center), int(_fixed(np.array(self.radius)))
        cv2.circle(pixels, center.tolist(), radius, self.color[::-1], -1, cv2.LINE_AA, _SHIFT)


@dataclass(frozen=True)
class _Text:
    x: float
    y: float
    text: str
    size: float
    anchor: str
    color: Color

    def svg(self) -> str:
        place = f'x="{self.x:.2f}" y="{self.y:.2f}" font-size="{self.size:g}"'
        style = f'text-anchor="{self.anchor}" fill="{css(self.color)}"'
        return f"<text {place} {style}>{escape(self.text)}</text>"

    def print(self, page: PdfPage) -> None:
        page.text(self.x, self.y, self.text, self.size, self.anchor, self.color)

    def paint(self, pixels: Pixels) -> None:
        font, scale = cv2.FONT_HERSHEY_SIMPLEX, self.size * _PNG_SCALE / 30
        (width, _), _ = cv2.getTextSize(self.text, font, scale, 1)
        x = self.x * _PNG_SCALE - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[self.anchor]
        place = round(x), round(self.y * _PNG_SCALE)
        cv2.putText(pixels, self.text, place, font, scale, self.color[::-1], 1, cv2.LINE_AA)


@dataclass
class Figure:
    """A white page; x goes right and y down, in units of one pixel on a screen."""

    width: int
    height: int
    _drawn: list[_Line | _Area | _Picture | _Dot | _Text] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the picture that `pixels` makes: height, width, 3."""
        return self.height * _PNG_SCALE, self.width * _PNG_SCALE, 3

    def line(self, points: Floats, color: Color, width: float = 1.0) -> None:
        """Draw a line through points (N, 2)."""
        self._drawn.append(_Line(np.asarray(points, np.float64), color, width))

    def area(self, points: Floats, color: Color) -> None:
        """Fill the polygon of points (N, 2)."""
        self._drawn.append(_Area(np.asarray(points, np.float64), color))

    def outline(self, box: Box, color: Color, width: float = 1.5) -> None:
        """Draw the outline of a rectangle."""
        corners = _corners(box)
        self.line(np.concatenate([corners, corners[:1]]), color, width)

    def fill(self, box: Box, color: Color) -> None:
        """Fill a rectangle."""
        self.area(_corners(box), color)

    def arrow(self, start: Floats, end: Floats, color: Color, width: float = 2.5) -> None:
        """Draw a line with a head at its end; points (2,)."""
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        aside = np.array([-along[1], along[0]])
        head = 4 * width
        self.line(np.array([start, end - head * along / 2]), color, width)
        self.area(
            np.array([end, *(end - head * along + s * aside * head / 2 for s in (1, -1))]), color
        )

    def picture(self, box: Box, pixels: Pixels, corner: tuple[int, int] | None = None) -> None:
        """Draw a picture; enlarged, its pixels stay squares.

        Args:
            box: its place.
            pixels: gray or BGR of 8 bits.
            corner: column and row of its first pixel in the image that the figure is about; None:
                it is not a part of that.
        """
        self._drawn.append(_Picture(box, pixels, corner))

    def pixel_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Column and row of the image's pixel that is drawn at a place of the figure."""
        pictures = (one for one in reversed(self._drawn) if isinstance(one, _Picture))
        return next((pixel for one in pictures if (pixel := one.pixel_at(x, y))), None)

    def dot(self, x: float, y: float, radius: float, color: Color) -> None:
        """Draw a filled circle."""
        self._drawn.append(_Dot(np.array([x, y]), radius, color))

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float = 12.0,
        anchor: str = "start",
        color: Color = (60, 60, 60),
    ) -> None:
        """Write a text whose ``start``, ``middle`` or ``end`` is at x; y is its base line."""
        self._drawn.append(_Text(x, y, text, size, anchor, color))

    def svg(self) -> bytes:
        """The figure as an SVG file."""
        size = f'width="{self.width}" height="{self.height}"'
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="Helvetica, sans-serif">',
            '<rect width="100%" height="100%" fill="white"/>',
            *(one.svg() for one in self._drawn),
        ]
        return "\n".join([*parts, "</svg>\n"]).encode()

    def pdf(self) -> bytes:
        """The figure as a PDF file; a unit is 1/96 inch."""
        page = PdfPage(self.width, self.height)
        for one in self._drawn:
            one.print(page)
        return page.file()

    def png(self) -> bytes:
        """The figure as a PNG file, of twice as many pixels as the page has units."""
        return _png(self.pixels())

    def pixels(self) -> Pixels:
        """The figure as a picture, BGR, of twice as many pixels as the page has units."""
        pixels = np.full(self.shape, 255, np.uint8)
        for one in self._drawn:
            one.paint(pixels)
        return pixels


FIGURE_FORMATS: dict[str, Callable[[Figure], bytes]] = {
    ".png": Figure.png,
    ".svg": Figure.svg,
    ".pdf": Figure.pdf,
}
"""Suffix of a file -> function that makes its content."""


def picture_grid(pictures: Sequence[tuple[str, Pixels]], columns: int) -> Figure:
    """Pictures of one size in a grid, each below its title."""
    height, across = pictures[0][1].shape[:2]
    cell = _GRID_WIDTH / columns
    shown = cell - 8
    row = shown * height / across + 26
    figure = Figure(_GRID_WIDTH, round(row * -(-len(pictures) // columns)))
    for number, (title, picture) in enumerate(pictures):
        left, top = (number % columns) * cell + 4, (number // columns) * row
        figure.text(left, top + 17, title, 13)
        figure.picture((left, top + 22, shown, row - 26), picture, (0, 0))
    return figure


def _png(pixels: Pixels) -> bytes:
    _, data = cv2.imencode(".png", pixels)
    return bytes(data)


def _corners(box: Box) -> Floats:
    left, top, width, height = box
    right, bottom = left + width, top + height
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def _pairs(points: Floats) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _fixed(numbers: Floats) -> Pixels:
    """Numbers in OpenCV's fixed-point notation."""
    fixed: Pixels = np.rint(numbers * _PNG_SCALE * (1 << _SHIFT)).astype(np.int32)
    return fixed
