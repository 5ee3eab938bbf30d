"""Placing windows on a screen so that none covers another."""

from __future__ import annotations

import math
from typing import NamedTuple

from ros_visualise.core.errors import UsageError

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
        area: the part of the screen for all of them.
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


def parse_place(text: str) -> tuple[int, int]:
    """``2/4``, the second of four, as (2, 4); an empty text as (1, 1).

    Raises:
        UsageError: it is not of that form.
    """
    number, slash, of = (text or "1/1").partition("/")
    if not (slash and number.isdecimal() and of.isdecimal() and 1 <= int(number) <= int(of)):
        raise UsageError(f"window={text}: give the place of a window as 2/4, the second of four")
    return int(number), int(of)


def part_of(area: Box, number: int, of: int) -> Box:
    """One of equal parts of an area, counted from 1 in rows."""
    columns = math.ceil(math.sqrt(of))
    rows = math.ceil(of / columns)
    row, column = divmod(number - 1, columns)
    width, height = area.width // columns, area.height // rows
    return Box(area.x + column * width, area.y + row * height, width, height)
