"""Curves drawn with letters, for a terminal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats

_TALL = 2.0  # a letter's height, in its widths


def draw_text(
    curves: Sequence[tuple[str, Floats]], across: str, up: str, columns: int, rows: int
) -> list[str]:
    """A frame with curves in it, both directions at one scale, and its ranges.

    Args:
        curves: the letter and the points (N, 2) of each; later ones are drawn over earlier ones.
        across, up: names of the two directions.
        columns, rows: available size, frame and text included.
    """
    points = np.concatenate([curve for _, curve in curves])
    low, high = points.min(axis=0), points.max(axis=0)
    room = np.array([columns - 2, (rows - 4) * _TALL])
    scale = _scale(high - low, room)
    size = np.rint((high - low) * scale / [1, _TALL]).astype(int)
    wide, tall = np.minimum(size + 1, [columns - 2, rows - 4]).tolist()
    canvas = np.full((tall, wide), " ")
    for letter, curve in curves:
        places = _dense((curve - low) * scale)
        x = np.rint(places[:, 0]).astype(int).clip(0, wide - 1)
        y = np.rint(places[:, 1] / _TALL).astype(int).clip(0, tall - 1)
        canvas[tall - 1 - y, x] = letter
    frame = f"+{'-' * wide}+"
    spans = [f"{n}: {a:.4g} to {b:.4g}" for n, a, b in zip((across, up), low, high, strict=True)]
    return [frame, *(f"|{''.join(row)}|" for row in canvas), frame, *spans]


def _scale(extent: Floats, room: Floats) -> float:
    """Letters per unit, so that everything fits."""
    room = room - [1, _TALL]
    fits = room[extent > 0] / extent[extent > 0]
    return float(fits.min()) if len(fits) else 1.0


def _dense(places: Floats) -> Floats:
    """Points along the lines between places, about half a letter apart."""
    steps = np.abs(np.diff(places, axis=0)).max(axis=1, initial=0)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    if at[-1] == 0:
        return places
    even = np.linspace(0, at[-1], int(2 * at[-1]) + 2)
    return np.stack([np.interp(even, at, axis) for axis in places.T], axis=1)
