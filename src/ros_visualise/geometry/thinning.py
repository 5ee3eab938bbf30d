"""Fewer points for the same shape, with a bound on how far the shape went astray."""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]

_TINY = float(np.finfo(np.float64).tiny)


def thin(points: Floats, astray_m: Floats, count: int) -> tuple[Indices, Floats]:
    """Choose the points of a polyline that keep its shape best, the ends among them.

    From the line between the ends, the piece that is farthest astray is split at its farthest point
    until there are ``count``. What was astray already adds up, so that the bound stays true
    however often a polyline is thinned.

    Args:
        points: (N, D), metres; N of at least 2.
        astray_m: (N - 1,): how far what once lay between two points may be from their line.
        count: how many stay; at least 2.

    Returns:
        Indices of those that stay, ascending, and for the lines between them (count - 1,) how far
        any point that was ever left out may be from its line.

    Source: D. Douglas and T. Peucker, "Algorithms for the reduction of the number of points
    required to represent a digitized line", Cartographica 10(2), 1973; here the pieces are split in
    the order of their errors, until a number is reached instead of a tolerance.
    """
    if len(points) <= count:
        return np.arange(len(points)), astray_m
    pieces = [_measure(points, astray_m, 0, len(points) - 1)]
    while len(pieces) + 1 < count:
        piece = heapq.heappop(pieces)
        heapq.heappush(pieces, _measure(points, astray_m, piece.first, piece.split))
        heapq.heappush(pieces, _measure(points, astray_m, piece.split, piece.last))
    pieces.sort(key=lambda piece: piece.first)
    kept = np.array([0, *(piece.last for piece in pieces)], np.intp)
    return kept, np.array([piece.astray_m for piece in pieces])


class _Piece(NamedTuple):
    """The line between two points; in a heap, the next one to split is the first."""

    order: float
    first: int
    last: int
    split: int
    astray_m: float


def _measure(points: Floats, astray_m: Floats, first: int, last: int) -> _Piece:
    away = _distances(points[first : last + 1])
    farthest = int(away.argmax())
    # A line between two points is in its whole length as near to another as the farther of them.
    astray = float((np.maximum(away[:-1], away[1:]) + astray_m[first:last]).max())
    if last - first == 1:
        return _Piece(math.inf, first, last, last, astray)
    if not away[farthest]:
        return _Piece(0.0, first, last, (first + last) // 2, astray)
    return _Piece(-astray, first, last, first + farthest, astray)


def _distances(points: Floats) -> Floats:
    """Of points (N, D) from the line between the first and the last of them."""
    apart = points - points[0]  # before anything is squared: coordinates may be large
    line = apart[-1]
    along = (apart @ line / max(line @ line, _TINY)).clip(0, 1)
    rest = apart - along[:, None] * line
    away: Floats = np.sqrt((rest * rest).sum(axis=1))
    away[0] = away[-1] = 0
    return away
