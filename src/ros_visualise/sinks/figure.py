"""Drawings of lines, areas, pictures, dots and texts, saved as SVG or PNG."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

_PNG_SCALE = 2
_SHIFT = 4  # bits of a pixel's fraction in OpenCV's drawing

Color = tuple[int, int, int]
Box = tuple[float, float, float, float]
"""Left, top, width, height."""


@dataclass(frozen=True)
class _Line:
    points: Floats
    color: Color
    width: float


@dataclass(frozen=True)
class _Area:
    points: Floats
    color: Color


@dataclass(frozen=True)
class _Picture:
    box: Box
    pixels: Pixels
    corner: tuple[int, int] | None


@dataclass(frozen=True)
class _Dot:
    x: float
    y: float
    radius: float
    color: Color


@dataclass(frozen=True)
class _Text:
    x: float
    y: float
    text: str
    size: float
    anchor: str
    color: Color


@dataclass
class Figure:
    """A white page; x goes right and y down, in units of which a screen shows one as a pixel."""

    width: int
    height: int
    _drawn: list[_Line | _Area | _Picture | _Dot | _Text] = field(default_factory=list)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of the picture that `pixels` makes: height, width, 3."""
        return self.height * _PNG_SCALE, self.width * _PNG_SCALE, 3

    def line(self, points: Floats, color: Color, width: float = 1.0) -> None:
        """A line through points (N, 2); colours are red, green, blue of 0 to 255."""
        self._drawn.append(_Line(np.asarray(points, np.float64), color, width))

    def area(self, points: Floats, color: Color) -> None:
        """What a line through points (N, 2) and back to the first encloses, filled."""
        self._drawn.append(_Area(np.asarray(points, np.float64), color))

    def picture(self, box: Box, pixels: Pixels, corner: tuple[int, int] | None = None) -> None:
        """A picture, gray or BGR of 8 bits; enlarged, its pixels stay squares.

        Args:
            box: where it is.
            pixels: of it.
            corner: column and row of its first pixel in what the figure is about; None: it is not
                a part of that.
        """
        self._drawn.append(_Picture(box, pixels, corner))

    def pixel_at(self, x: float, y: float) -> tuple[int, int] | None:
        """Column and row, in what the figure is about, of the pixel that is drawn at a place."""
        for one in reversed(self._drawn):
            if isinstance(one, _Picture) and one.corner is not None:
                height, width = one.pixels.shape[:2]
                column = math.floor((x - one.box[0]) * width / one.box[2])
                row = math.floor((y - one.box[1]) * height / one.box[3])
                if 0 <= column < width and 0 <= row < height:
                    return one.corner[0] + column, one.corner[1] + row
        return None

    def dot(self, x: float, y: float, radius: float, color: Color) -> None:
        """A filled circle."""
        self._drawn.append(_Dot(x, y, radius, color))

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float = 12.0,
        anchor: str = "start",
        color: Color = (60, 60, 60),
    ) -> None:
        """A text whose ``start``, ``middle`` or ``end`` is at x; y is its base line."""
        self._drawn.append(_Text(x, y, text, size, anchor, color))

    def svg(self) -> bytes:
        """As an SVG file."""
        size = f'width="{self.width}" height="{self.height}"'
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="Helvetica, sans-serif">',
            '<rect width="100%" height="100%" fill="white"/>',
        ]
        for one in self._drawn:
            if isinstance(one, _Line):
                points = " ".join(f"{x:.2f},{y:.2f}" for x, y in one.points)
                stroke = f'stroke="{_hex(one.color)}" stroke-width="{one.width:g}"'
                style = f'fill="none" {stroke} stroke-linejoin="round"'
                parts.append(f'<polyline points="{points}" {style}/>')
            elif isinstance(one, _Area):
                points = " ".join(f"{x:.2f},{y:.2f}" for x, y in one.points)
                parts.append(f'<polygon points="{points}" fill="{_hex(one.color)}"/>')
            elif isinstance(one, _Picture):
                parts.append(_embedded(one))
            elif isinstance(one, _Dot):
                place = f'cx="{one.x:.2f}" cy="{one.y:.2f}" r="{one.radius:g}"'
                parts.append(f'<circle {place} fill="{_hex(one.color)}"/>')
            else:
                place = f'x="{one.x:.2f}" y="{one.y:.2f}" font-size="{one.size:g}"'
                style = f'text-anchor="{one.anchor}" fill="{_hex(one.color)}"'
                parts.append(f"<text {place} {style}>{escape(one.text)}</text>")
        return "\n".join([*parts, "</svg>\n"]).encode()

    def png(self) -> bytes:
        """As a PNG file, of twice as many pixels as the page has units."""
        return _png(self.pixels())

    def pixels(self) -> Pixels:
        """As a picture, BGR, of twice as many pixels as the page has units."""
        pixels = np.full(self.shape, 255, np.uint8)
        for one in self._drawn:
            _paint(pixels, one)
        return pixels


FIGURE_FORMATS: dict[str, Callable[[Figure], bytes]] = {
    ".png": Figure.png,
    ".svg": Figure.svg,
}
"""A file's suffix -> what makes it."""


def _paint(pixels: Pixels, one: _Line | _Area | _Picture | _Dot | _Text) -> None:
    if isinstance(one, _Line):
        width = max(1, round(one.width * _PNG_SCALE))
        points = [_all_fixed(one.points)]
        cv2.polylines(pixels, points, False, one.color[::-1], width, cv2.LINE_AA, _SHIFT)
    elif isinstance(one, _Area):
        cv2.fillPoly(pixels, [_all_fixed(one.points)], one.color[::-1], cv2.LINE_AA, _SHIFT)
    elif isinstance(one, _Picture):
        _place(pixels, one)
    elif isinstance(one, _Dot):
        center, radius = (_fixed(one.x), _fixed(one.y)), _fixed(one.radius)
        cv2.circle(pixels, center, radius, one.color[::-1], -1, cv2.LINE_AA, _SHIFT)
    else:
        _write(pixels, one)


def _place(pixels: Pixels, one: _Picture) -> None:
    left, top, width, height = (round(number * _PNG_SCALE) for number in one.box)
    is_larger = one.pixels.shape[1] < width
    how = cv2.INTER_NEAREST if is_larger else cv2.INTER_AREA
    scaled = cv2.resize(one.pixels, (width, height), interpolation=how)
    colors = cv2.cvtColor(scaled, cv2.COLOR_GRAY2BGR) if scaled.ndim == 2 else scaled
    place = pixels[top : top + height, left : left + width]
    place[:] = colors[: place.shape[0], : place.shape[1]]


def _embedded(one: _Picture) -> str:
    left, top, width, height = one.box
    place = f'x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}"'
    style = 'preserveAspectRatio="none" style="image-rendering: pixelated"'
    data = b64encode(_png(one.pixels)).decode()
    return f'<image {place} {style} href="data:image/png;base64,{data}"/>'


def _png(pixels: Pixels) -> bytes:
    _, data = cv2.imencode(".png", pixels)
    return bytes(data)


def _hex(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


def _fixed(number: float) -> int:
    return round(number * _PNG_SCALE * (1 << _SHIFT))


def _all_fixed(points: Floats) -> Pixels:
    fixed: Pixels = np.rint(points * _PNG_SCALE * (1 << _SHIFT)).astype(np.int32)
    return fixed


def _write(pixels: Pixels, one: _Text) -> None:
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, one.size * _PNG_SCALE / 30
    (width, _), _ = cv2.getTextSize(one.text, font, scale, 1)
    x = one.x * _PNG_SCALE - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[one.anchor]
    place = round(x), round(one.y * _PNG_SCALE)
    cv2.putText(pixels, one.text, place, font, scale, one.color[::-1], 1, cv2.LINE_AA)
