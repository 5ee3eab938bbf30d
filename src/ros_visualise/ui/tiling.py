"""Where windows go on a screen, so that none covers another."""

from __future__ import annotations

import math
from typing import NamedTuple

TITLE = 36  # what a window manager adds above a window, in pixels
_EDGE = 6  # and around it


class Box(NamedTuple):
    """A window's place: its top-left corner with its frame, its size without."""

    x: int
    y: int
    width: int
    height: int


def tile(area: Box, extras: list[int]) -> list[Box]:
    """Places for windows with images, in rows of equally many, all images equally large.

    Args:
        area: what is there for them.
        extras: for each window, the height that it needs beside its image.
    """
    if not extras:
        return []
    columns = math.ceil(math.sqrt(len(extras)))
    rows = [extras[i : i + columns] for i in range(0, len(extras), columns)]
    width = area.width // columns
    image = (area.height - sum(max(row) + TITLE for row in rows)) // len(rows)
    boxes, y = [], area.y
    for row in rows:
        for column, extra in enumerate(row):
            x, height = area.x + column * width, max(image, width // 4) + extra
            boxes.append(Box(x, y, width - _EDGE, height - _EDGE))
        y += max(image, width // 4) + max(row) + TITLE
    return boxes
