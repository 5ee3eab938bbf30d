"""Association of boxes with tracks: overlap, and the assignment of the least total cost."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]


def overlap(first: Floats, second: Floats, margins_uv: Floats) -> Floats:
    """Intersection over union of boxes (N, 4) and (M, 4): (N, M).

    Both boxes of a pair are enlarged on each side by ``margins_uv`` (N, 2), so that small and fast
    objects overlap too.

    Source: Yang et al., Hard to track objects with irregular motions, 2023 (buffered IoU).
    """
    shared, whole_a, whole_b = np.ones((3, len(first), len(second)))
    for axis in (0, 1):  # reductions over an axis of two cost more than the rest
        grown = 2 * margins_uv[:, None, axis]
        a = first[:, None, 2 + axis] + grown
        b = second[None, :, 2 + axis] + grown
        apart = np.abs(first[:, None, axis] - second[None, :, axis])
        shared *= np.maximum(np.minimum((a + b) / 2 - apart, np.minimum(a, b)), 0)
        whole_a *= a
        whole_b *= b
    return shared / (whole_a + whole_b - shared)


def assign(costs: Floats, limit: float) -> tuple[Indices, Indices]:
    """The rows and columns of the pairs with the least total cost.

    A row or column without a pair costs half of the limit: no pair costs more than the limit.
    """
    allowed = costs < limit
    rows, columns = np.nonzero(allowed)
    alone = (allowed.sum(1)[rows] == 1) & (allowed.sum(0)[columns] == 1)
    if alone.all():
        return rows, columns
    some_rows, some_columns = np.unique(rows[~alone]), np.unique(columns[~alone])
    found = _least(np.minimum(costs[np.ix_(some_rows, some_columns)], limit), limit)
    chosen = some_rows[found[0]], some_columns[found[1]]
    good = allowed[chosen]
    return np.r_[rows[alone], chosen[0][good]], np.r_[columns[alone], chosen[1][good]]


def _least(costs: Floats, limit: float) -> tuple[Indices, Indices]:
    """The assignment as a problem of transport: equal weights give whole flows."""
    side = max(costs.shape)
    square = np.full((side, side), limit, np.float32)
    square[: costs.shape[0], : costs.shape[1]] = costs
    weights = np.ones((side, 1), np.float32)
    flow = cv2.EMD(weights, weights, cv2.DIST_USER, square)[2]
    rows, columns = np.nonzero(flow[: costs.shape[0], : costs.shape[1]] > 0.5)
    return rows, columns
