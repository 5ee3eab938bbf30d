"""Refitting one tag with fixed views: its possible poses and sizes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.minimising import GATE
from ros_visualise.estimation.mapping.motions import between, in_view
from ros_visualise.estimation.mapping.normal import Numbers
from ros_visualise.estimation.mapping.problem import Flags, Poses
from ros_visualise.estimation.mapping.terms import Terms
from ros_visualise.estimation.mapping.unknowns import Unknowns
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose.rays import Rays
from ros_visualise.landmarks.pose.refinement import linearise, moved

_ROUNDS = 12
_BEGINNINGS = 5
FARTHEST = 1000.0
"""Largest visible distance of a tag, in sides."""

_LOOSE = 9.0  # times the gate, as the views are uncertain too


class Refit(NamedTuple):
    """A tag's pose (3, 3) and (3,), the ratio of its size to the given one, and the inliers."""

    R: Floats
    t: Floats
    size: float
    fits: Flags


def refit(terms: Terms, state: Unknowns, rows: Numbers, sized: bool) -> Refit | None:
    """The pose, and the size if ``sized``, supported by most of a tag's sightings (R,)."""
    best, eyes = None, terms.eyes(state)
    scales = (1.0, 0.5, 0.7, 1.4, 2.0) if sized else (1.0,)
    for row in rows[:: max(1, len(rows) // _BEGINNINGS)]:
        for hypothesis in terms.problem.sightings[row].hypotheses:
            for scale in scales:
                R = eyes.R[row] @ rotations.to_matrix(hypothesis.quat_xyzw)
                t = eyes.t[row] + scale * eyes.R[row] @ hypothesis.position_xyz
                found = _fitted(terms, state, rows, Refit(R, t, scale, rows > 0), sized)
                if best is None or found.fits.sum() > best.fits.sum():
                    best = found
    return best


def _fitted(terms: Terms, state: Unknowns, rows: Numbers, start: Refit, sized: bool) -> Refit:
    R, t, size = start.R, start.t, start.size
    residuals, by = _seen(terms, state, rows, R, t, size)
    for _ in range(_ROUNDS):
        chi2 = (residuals**2).sum(axis=1)
        scale = max(_LOOSE * GATE, float(np.median(chi2)))
        weights = (scale / (scale + chi2))[:, None]
        J = (by * weights[..., None]).reshape(-1, 7)[:, : 6 + sized]
        information = J.T @ J + 1e-6 * np.eye(J.shape[1])
        step = -np.linalg.solve(information, J.T @ (residuals * weights).ravel())
        step /= max(1.0, float(np.abs(step[3:6]).max()) / 0.3)
        R, t = moved(R, t, step[:6])
        if sized:
            size = max(size * float(np.exp(np.clip(step[6], -0.5, 0.5))), 1e-3)
        residuals, by = _seen(terms, state, rows, R, t, size)
    ranges = np.linalg.norm(terms.eyes(state).t[rows] - t, axis=1)
    in_range = ranges < FARTHEST * terms.problem.sightings[rows[0]].size_m
    return Refit(R, t, size, ((residuals**2).sum(axis=1) < _LOOSE * GATE) & in_range)


def _seen(
    terms: Terms, state: Unknowns, rows: Numbers, R: Floats, t: Floats, size: float
) -> tuple[Floats, Floats]:
    """Residuals (R, 8), and derivatives (R, 8, 7) by the pose and the logarithm of the size."""
    points, rays, eyes = terms.corners.points, terms.corners.rays, terms.eyes(state).at(rows)
    body = Poses(R[None], t[None])
    in_camera = in_view(eyes, body)
    whiten = np.eye(8) / terms.sigma_px()[rows, None, None]
    seen = Rays(rays.directions[rows], rays.to_pixels[rows])
    residuals, by_pose = linearise(*in_camera, points[rows] * size, seen, whiten)
    larger, _ = linearise(*in_camera, points[rows] * size * (1 + 1e-6), seen, whiten)
    with np.errstate(invalid="ignore"):
        by_size = (larger - residuals)[..., None] / 1e-6
    by = np.concatenate([between(by_pose, eyes, eyes.t, body)[1], by_size], axis=2)
    bad = ~np.asarray(np.isfinite(residuals).all(axis=1))
    return np.where(bad[:, None], 1e3, residuals), np.where(bad[:, None, None], 0, by)
