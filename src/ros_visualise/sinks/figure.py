"""Drawings of lines, dots and texts, saved as SVG or PNG."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

_PNG_SCALE = 2
_SHIFT = 4  # bits of a pixel's fraction in OpenCV's drawing

Color = tuple[int, int, int]


@dataclass(frozen=True)
class _Line:
    points: Floats
    color: Color
    width: float


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
    _drawn: list[_Line | _Dot | _Text] = field(default_factory=list)

    def line(self, points: Floats, color: Color, width: float = 1.0) -> None:
        """A line through points (N, 2); colours are red, green, blue of 0 to 255."""
        self._drawn.append(_Line(np.asarray(points, np.float64), color, width))

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
        shape = (self.height * _PNG_SCALE, self.width * _PNG_SCALE, 3)
        pixels = np.full(shape, 255, np.uint8)
        for one in self._drawn:
            color = one.color[::-1]
            if isinstance(one, _Line):
                points = [np.rint(one.points * _PNG_SCALE * 2**_SHIFT).astype(np.int32)]
                width = max(1, round(one.width * _PNG_SCALE))
                cv2.polylines(pixels, points, False, color, width, cv2.LINE_AA, _SHIFT)
            elif isinstance(one, _Dot):
                center = _fixed(one.x), _fixed(one.y)
                cv2.circle(pixels, center, _fixed(one.radius), color, -1, cv2.LINE_AA, _SHIFT)
            else:
                _write(pixels, one)
        _, data = cv2.imencode(".png", pixels)
        return bytes(data)


FIGURE_FORMATS: dict[str, Callable[[Figure], bytes]] = {
    ".png": Figure.png,
    ".svg": Figure.svg,
}
"""A file's suffix -> what makes it."""


def _hex(color: Color) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)


def _fixed(number: float) -> int:
    return round(number * _PNG_SCALE * (1 << _SHIFT))


def _write(pixels: Pixels, one: _Text) -> None:
    font, scale = cv2.FONT_HERSHEY_SIMPLEX, one.size * _PNG_SCALE / 30
    (width, _), _ = cv2.getTextSize(one.text, font, scale, 1)
    x = one.x * _PNG_SCALE - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[one.anchor]
    place = round(x), round(one.y * _PNG_SCALE)
    cv2.putText(pixels, one.text, place, font, scale, one.color[::-1], 1, cv2.LINE_AA)
