"""Colours that tell things apart."""

from __future__ import annotations

import zlib

Color = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

PALETTE: tuple[Color, ...] = (
    (77, 171, 247),
    (255, 146, 43),
    (81, 207, 102),
    (218, 119, 242),
    (255, 224, 102),
    (255, 90, 90),
    (32, 201, 190),
    (176, 124, 84),
    (233, 236, 239),
    (112, 92, 240),
    (255, 170, 200),
    (150, 165, 60),
)
"""In the order in which they are given; no two of them look alike."""


def css(color: Color) -> str:
    """As a style sheet has it."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def color_of(class_id: str) -> Color:
    """The same for the same class, wherever and whenever."""
    return PALETTE[zlib.crc32(class_id.encode()) % len(PALETTE)]
