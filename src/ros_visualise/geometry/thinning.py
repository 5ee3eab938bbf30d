"""Fewer points of a line or a series, chosen so that what they show stays the same."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]

_TINY = float(np.finfo(np.float64).tiny)


def simplify(points: Floats, errors_m: Floats, count: int) -> tuple[Indices, Floats]:
    """Choose the points of a polyline that keep its shape best, the ends among them.

    Starting with the line between the ends, the piece with the largest error is split at its
    farthest point until there are ``count``. Earlier errors add up, so that the bound stays true
    however often a polyline is simplified.

    Args:
        points: (N, D), metres; N of at least 2.
        errors_m: (N - 1,): largest distance of points removed earlier from the line between two
            neighbours.
        count: number of points to keep; at least 2.

    Returns:
        Indices of the kept points, ascending, and for the lines between them (count - 1,) the
        largest distance of any removed point from its line.

    Source: D. Douglas and T. Peucker, "Algorithms for the reduction of the number of points
    required to represent a digitized line", Cartographica 10(2), 1973; here the pieces are split in
    the order of their errors, until a number is reached instead of a tolerance.
    """
    if len(points) <= count:
        return np.arange(len(points)), errors_m
    pieces = [_measure(points, errors_m, 0, len(points) - 1)]
    while len(pieces) + 1 < count:
        piece = heapq.heappop(pieces)
        heapq.heappush(pieces, _measure(points, errors_m, piece.first, piece.split))
        heapq.heappush(pieces, _measure(points, errors_m, piece.split, piece.last))
    pieces.sort(key=lambda piece: piece.first)
    kept = np.array([0, *(piece.last for piece in pieces)], np.intp)
    return kept, np.array([piece.error_m for piece in pieces])


def extremes(values: Floats, count: int) -> Indices:
    """Choose at most so many of the values (N,): the lowest and the highest of each stretch.

    No peak is lost. NaN is chosen only where a stretch holds nothing else.
    """
    if len(values) <= count:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), max(count // 2, 1) + 1).astype(np.intp)[1:-1]
    is_finite = np.isfinite(values)
    lows = np.split(np.where(is_finite, values, np.inf), edges)
    highs = np.split(np.where(is_finite, values, -np.inf), edges)
    starts = np.concatenate([[0], edges])
    chosen = [[low.argmin(), high.argmax()] for low, high in zip(lows, highs, strict=True)]
    return np.unique(starts[:, None] + chosen)


def evenly(total: int, count: int) -> Indices:
    """Choose at most so many of a number of things, evenly, the first and the last among them."""
    return np.linspace(0, total - 1, min(total, count)).astype(np.intp)


class _Piece(NamedTuple):
    """The line between two points; the first one in a heap is to be split next."""

    order: float
    first: int
    last: int
    split: int
    error_m: float


def _measure(points: Floats, errors_m: Floats, first: int, last: int) -> _Piece:
    away = _distances(points[first : last + 1])
    farthest = int(away.argmax())
    # No point of a line is farther from another line than the farther one of its ends.
    error = float((np.maximum(away[:-1], away[1:]) + errors_m[first:last]).max())
    if last - first == 1:
        return _Piece(math.inf, first, last, last, error)
    if not away[farthest]:
        return _Piece(0.0, first, last, (first + last) // 2, error)
    return _Piece(-error, first, last, first + farthest, error)


def _distances(points: Floats) -> Floats:
    """Distances of points (N, D) from the line between the first and the last of them."""
    apart = points - points[0]  # before anything is squared: coordinates may be large
    line = apart[-1]
    along = (apart @ line / max(line @ line, _TINY)).clip(0, 1)
    rest = apart - along[:, None] * line
    away: Floats = np.sqrt((rest * rest).sum(axis=1))
    away[0] = away[-1] = 0
    return away
