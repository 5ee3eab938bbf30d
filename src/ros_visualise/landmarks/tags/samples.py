"""Pixels of tags that determine the corners: those near edges between black and white."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.tags.views import TagView

_OUTSIDE = 0.6  # width of the used margin around the square, cells
_NEAR_PX = 2.5  # largest distance from an edge between cells
_MOST, _CANDIDATES = 900, 6000  # pixels of a tag used, and considered
LEAST = 60
"""Fewest pixels of a tag that is fitted."""


class TagSamples(NamedTuple):
    """N pixels of each of T tags; for padding, some have zero weight."""

    places: Floats
    """(T, N, 2) in the views of the tags."""
    gray: Floats
    weight: Floats


def sample_tags(
    gray: Pixels, corners: Floats, views: Sequence[TagView], patterns: Floats, square: Floats
) -> TagSamples:
    """The pixels of T tags.

    Args:
        gray: (height, width) uint8.
        corners: (T, 4, 2) places in the views.
        views: of the tags.
        patterns: (T, C, C) by x, then by y upwards; 1 is white.
        square: (4, 2) the corners of a tag in cells, from the lower left of the print.
    """
    several = [
        _near_edges(gray, *one, square) for one in zip(corners, views, patterns, strict=True)
    ]
    many = max([LEAST, *(len(levels) for _, levels in several)])
    places, levels = np.zeros((len(several), many, 2)), np.zeros((len(several), many))
    weight = np.zeros_like(levels)
    for tag, (there, seen) in enumerate(several):
        count = len(seen)
        places[tag, :count], levels[tag, :count] = there, seen
        weight[tag, :count] = (seen > 0) & (seen < 255)
    return TagSamples(places, levels, weight)


def _near_edges(
    gray: Pixels, corners: Floats, view: TagView, pattern: Floats, square: Floats
) -> tuple[Floats, Floats]:
    """Places (N, 2) and gray levels (N,) of a tag's pixels near edges between different cells.

    They are evenly thinned.
    """
    H = homographies(corners[None], square)[0]
    (low, _), (high, _) = square[0] - _OUTSIDE, square[2] + _OUTSIDE
    around = np.array([[low, low, 1], [high, low, 1], [high, high, 1], [low, high, 1]])
    outline = around @ np.linalg.inv(H).T
    outline = outline[:, :2] / outline[:, 2:] + view.middle_uv
    first = np.maximum(np.ceil(outline.min(axis=0)), 0).astype(int)
    last = np.minimum(np.floor(outline.max(axis=0)), np.array(gray.shape[::-1]) - 1).astype(int)
    every = max(1, int(np.sqrt(max(np.prod(last - first + 1.0), 0) / _CANDIDATES)))
    every += 1 - every % 2  # even steps would meet blocks of JPEG and mosaics always alike
    u, v = (np.arange(a, b + 1, every) for a, b in zip(first, last, strict=True))
    p, q = view.of_grid(u, v)
    x, y, depth = (row[0] * p + row[1] * q + row[2] for row in H)
    x, y = x / depth, y / depth
    cell_px = np.sqrt(_area(corners)) / (square[2, 0] - square[0, 0])
    apart = cell_px * np.minimum(np.abs(x - np.rint(x)), np.abs(y - np.rint(y)))
    inside = (x > low) & (x < high) & (y > low) & (y < high) & (apart < _NEAR_PX)
    rows, columns = np.nonzero(inside)
    x, y = (np.clip(np.floor(one[inside] - 0.5).astype(int), 0, len(pattern) - 2) for one in (x, y))
    whites = pattern[x, y] + pattern[x + 1, y] + pattern[x, y + 1] + pattern[x + 1, y + 1]
    near = np.flatnonzero((whites > 0) & (whites < 4))
    thinned = near[np.linspace(0, len(near) - 1, min(len(near), _MOST)).astype(int)]
    rows, columns = rows[thinned], columns[thinned]
    places = np.stack([p[rows, columns], q[rows, columns]], axis=1)
    return places, gray[v[rows], u[columns]].astype(np.float64)


def _area(corners: Floats) -> float:
    (a, b), (c, d) = corners[2] - corners[0], corners[3] - corners[1]
    return float(abs(a * d - b * c) / 2)


def homographies(corners: Floats, square: Floats) -> Floats:
    """(T, 3, 3) from pixels relative to the centres of tags (T, 4, 2) to cells (4, 2)."""
    x, y = np.broadcast_to(square, corners.shape).transpose(2, 0, 1)
    u, v = corners.transpose(2, 0, 1)
    one, none = np.ones_like(u), np.zeros_like(u)
    rows = [
        np.stack([u, v, one, none, none, none, -u * x, -v * x], axis=2),
        np.stack([none, none, none, u, v, one, -u * y, -v * y], axis=2),
    ]
    equations = np.concatenate(rows, axis=1)
    equations = np.where(np.isfinite(equations), equations, 0) + 1e-12 * np.eye(8)
    solved = np.linalg.solve(equations, np.concatenate([x, y], axis=1)[..., None])[..., 0]
    whole = np.concatenate([solved, np.ones((len(solved), 1))], axis=1)
    return np.asarray(whole.reshape(-1, 3, 3))
