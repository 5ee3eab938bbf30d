"""The pose of an image by known points: robust least squares over its six numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.bundle import HUBER, Mask, by_twist, project
from ros_visualise.geometry import se3

ALIKE = 9.0
"""Sightings that count as one independent sighting: the errors of a corner's sightings are alike,
because its patch drifts. Measured by the errors of simulated flights.
"""
OUTLIER = 3.5
"""Standard deviations of directions beyond which a sighting does not fit."""
_BY_POSE = 1.5 * OUTLIER  # the same, of a pose whose points are not adjusted with it
_LEAST_POINTS = 8
_LOCATING = (16.0, 4, 1, 1)  # standard deviations beyond which points hardly count, by step


class Located(NamedTuple):
    """A pose T_map_camera by known points, and the covariance (6, 6) of its twist.

    ``used`` points of those ``seen`` agree; ``residual`` is a robust standard deviation.
    """

    R: Floats
    p: Floats
    covariance: Floats
    used: int
    seen: int
    residual: float


def locate(points: Floats, R: Floats, p: Floats, rays: Floats, sigma: float) -> Located | None:
    """The pose from which points are seen in directions (N, 2), starting from a guess.

    Args:
        points: (N, 4), homogeneous, in the map.
        sigma: standard deviation of directions.

    Returns:
        None if there are too few points.
    """
    if len(points) < _LEAST_POINTS:
        return None
    seen = rays[None]
    for wide in _LOCATING:
        r, J, is_valid = _by_pose(points, R, p, seen)
        w = np.where(is_valid, _cauchy(r, wide * sigma), 0)[:, None, None]
        weighted = (J * w).reshape(-1, 6).T
        H, g = weighted @ J.reshape(-1, 6), weighted @ r.ravel()
        twist = np.linalg.solve(H + 1e-9 * np.trace(H) * np.eye(6), g)
        R, p = se3.moved(twist, R, p)
    R = orthogonal(R)
    r, J, is_valid = _by_pose(points, R, p, seen)
    off = np.linalg.norm(r, axis=1)
    used = is_valid & (off < _BY_POSE * sigma)
    J = J[used].reshape(-1, 6)
    covariance = ALIKE * np.linalg.pinv(J.T @ J / sigma**2, hermitian=True)
    residual = float(np.median(off)) / 1.1774
    return Located(R, p, covariance, int(used.sum()), len(points), residual)


def orthogonal(R: Floats) -> Floats:
    """Rotations (..., 3, 3) without rounding errors, which would double from image to image."""
    U, _, Vt = np.linalg.svd(R)
    found: Floats = U @ Vt
    return found


def _by_pose(points: Floats, R: Floats, p: Floats, rays: Floats) -> tuple[Floats, Floats, Mask]:
    """Residuals (N, 2) of one view, their derivatives (N, 2, 6), and which are valid (N,)."""
    r, depth, is_valid = project(points, R[None], p[None], rays)
    expected = np.where(is_valid[..., None], rays - r, 0.0)
    return r[0], by_twist(points, R[None], expected, depth)[0], is_valid[0]


def _cauchy(residuals: Floats, sigma: float) -> Floats:
    """(N,) weights by which outliers hardly count."""
    squares = (residuals**2).sum(axis=1) / sigma**2
    found: Floats = 1 / (1 + squares / HUBER**2) / sigma**2
    return found
