"""Colours that tell things apart."""

from __future__ import annotations

import zlib

Color = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

PALETTE: tuple[Color, ...] = (
    (77, 171, 247),
    (255, 169, 77),
    (105, 219, 124),
    (218, 119, 242),
    (255, 212, 59),
    (255, 135, 135),
)


def color_of(class_id: str) -> Color:
    """The same for the same class, wherever and whenever."""
    return PALETTE[zlib.crc32(class_id.encode()) % len(PALETTE)]
