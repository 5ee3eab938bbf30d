"""Covariance of a calibration whose errors are not independent.

The inverse of the information is the covariance if the errors of all points are independent. Those
of one view are not: they share its light, blur and motion, and a model of the lens that is not
quite right. So whole views are what counts: the covariance is that of the results without one view
each (the jackknife), and larger where views that follow one another share errors too. All sightings
of one point of the board share the error of its print, which is added likewise.

Source: B. Efron, The Jackknife, the Bootstrap and Other Resampling Plans, 1982, chapter 3; A.
Cameron, D. Miller, A Practitioner's Guide to Cluster-Robust Inference, Journal of Human Resources
50, 2015, sections VI.B (the same for clusters) and V.A (views and points).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.calibration.boards import Ints

_BLOCK = 3  # consecutive views that may share errors
_BLOCKS = 4  # least number of blocks of views
_LEAST = 1e-12  # of sums of squares, where all fits exactly


def covariance_of(
    rows: Sequence[tuple[Floats, Floats, Floats]], prior: Floats, numbers: Ints, cost: float
) -> Floats:
    """(n, n) covariance of what the views share, by how much they contradict one another.

    With few views the jackknife is itself uncertain, and blind in some directions. So it is
    averaged with the covariance of independent errors, enlarged to the same size.

    Args:
        rows: of each view, the derivatives (2N, n) by what is shared and (2N, 6) by the board's
            pose, and the residuals (2N,), pixels.
        prior: (n, n) information beyond the views.
        numbers: (N of all views,) of the points on the board.
        cost: sum of the squared residuals.
    """
    information, scores = [], []
    for A, B, residual in rows:
        J = A - B @ (np.linalg.pinv(B) @ A)  # without the view's pose
        information.append(J.T @ J)
        scores.append((J * residual[:, None]).reshape(-1, 2, len(A.T)).sum(axis=1))
    S = prior + sum(information)
    free = max(sum(len(r) for *_, r in rows) - len(S) - 6 * len(rows), 1)
    independent = _inverse(S) * max(cost, _LEAST) / free
    views = [(one, score.sum(axis=0)) for one, score in zip(information, scores, strict=True)]
    by_views = _jackknife(S, views, 1)
    by_blocks = _jackknife(S, views, int(np.clip(len(views) // _BLOCKS, 1, _BLOCK)))
    larger = max(np.trace(S @ by_views) / np.trace(S @ independent), 1.0)
    shared = max(np.trace(S @ by_blocks) / max(np.trace(S @ by_views), _LEAST), 1.0)
    covariance: Floats = shared * (by_views + larger * independent) / 2
    return covariance + _by_points(S, np.vstack(scores), numbers)


def _by_points(S: Floats, scores: Floats, numbers: Ints) -> Floats:
    """Covariance that sightings of one point of the board share; ``scores`` (N, n) of each."""
    of_points = np.array([scores[numbers == one].sum(axis=0) for one in np.unique(numbers)])
    larger = len(of_points) / max(len(of_points) - 1, 1)
    inverse = _inverse(S)
    beyond = inverse @ (larger * of_points.T @ of_points - scores.T @ scores) @ inverse
    scale = np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    values, axes = np.linalg.eigh(beyond / np.outer(scale, scale))
    positive: Floats = (axes * np.maximum(values, 0)) @ axes.T * np.outer(scale, scale)
    return positive


def _jackknife(S: Floats, views: Sequence[tuple[Floats, Floats]], size: int) -> Floats:
    """Covariance by how the result changes without each block of ``size`` views."""
    moves = []
    for start in range(0, len(views), size):
        block = views[start : start + size]
        moves.append(_inverse(S - sum(U for U, _ in block)) @ sum(g for _, g in block))
    apart = np.array(moves)
    covariance: Floats = (len(moves) - 1) / len(moves) * apart.T @ apart
    return covariance


def _inverse(matrix: Floats) -> Floats:
    """Pseudo-inverse of information about numbers of very different magnitude."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    inverse: Floats = np.linalg.pinv(matrix * np.outer(scale, scale)) * np.outer(scale, scale)
    return inverse
