"""Colours that tell things apart, and colour maps of values."""

from __future__ import annotations

import zlib

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

Color = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""

INK: Color = (40, 40, 40)
BLUE: Color = (31, 111, 178)
RED: Color = (200, 50, 40)
GREEN: Color = (44, 145, 60)
ORANGE: Color = (230, 140, 20)
YELLOW: Color = (255, 220, 0)
GRAY: Color = (150, 150, 150)

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
"""Distinct colours on a dark page, in the order in which they are assigned."""


def css(color: Color) -> str:
    """A colour in CSS notation."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def color_of(class_id: str) -> Color:
    """The colour of a class, always the same one."""
    return PALETTE[zlib.crc32(class_id.encode()) % len(PALETTE)]


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
