"""Pose refinement by Levenberg-Marquardt: minimises the reprojection error of a body's points.

Several poses are refined at once. A pose is the rotation ``R`` (3, 3) and the position ``t`` (3,)
of the body in the camera's optical frame. Its six increments are, in this order, those of the
position and a rotation about the camera's axes: ``R`` becomes ``exp(w) R``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose.rays import Rays

_ROUNDS = 50
_SMALLEST_STEP = 1e-9
_DAMPING, _MOST_DAMPING = 1e-4, 1e12
_NEAR = 1e-6  # least depth of a point, as a fraction of its distance


class RefinedPoses(NamedTuple):
    """B refined poses of N points."""

    R: Floats
    """(B, 3, 3)"""
    t: Floats
    """(B, 3) metres"""
    chi2: Floats
    """(B,) sum of squared whitened residuals; infinite behind the camera."""
    information: Floats
    """(B, 6, 6) the inverse of the covariance to first order."""


def refine(R: Floats, t: Floats, points: Floats, rays: Rays, whiten: Floats) -> RefinedPoses:
    """Refine poses, each from its own start.

    Args:
        R, t: (B, 3, 3) and (B, 3), initial poses.
        points: (B, N, 3) metres in the body's frame.
        rays: of their pixels, (B, N, ...).
        whiten: (B, 2N, 2N) see `corner_noise.whitening`.

    Source: J. Nocedal, S. Wright, Numerical Optimization, 2006, chapter 10; the damping by D.
    Marquardt, 1963.
    """
    damping = np.full(len(t), _DAMPING)
    residuals, jacobian = linearise(R, t, points, rays, whiten)
    chi2 = _sum_of_squares(residuals)
    for _ in range(_ROUNDS):
        information, slope = _normal_equations(residuals, jacobian)
        step = _damped_step(information, slope, damping)
        new_R, new_t = moved(R, t, step)
        new_residuals, new_jacobian = linearise(new_R, new_t, points, rays, whiten)
        new_chi2 = _sum_of_squares(new_residuals)
        better = new_chi2 <= chi2
        R, t = np.where(better[:, None, None], new_R, R), np.where(better[:, None], new_t, t)
        residuals = np.where(better[:, None], new_residuals, residuals)
        jacobian = np.where(better[:, None, None], new_jacobian, jacobian)
        with np.errstate(invalid="ignore"):  # if none starts behind the camera
            gain = chi2 - np.where(better, new_chi2, chi2)
        chi2 = np.where(better, new_chi2, chi2)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-12, _MOST_DAMPING)
        tiny = np.abs(step).max(axis=1) < _SMALLEST_STEP * np.maximum(1, np.abs(t).max(axis=1))
        settled = better & (gain < 1e-9 * (1 + chi2))
        if (tiny | settled | (damping >= _MOST_DAMPING) | ~np.isfinite(chi2)).all():
            break
    return RefinedPoses(R, t, chi2, _normal_equations(residuals, jacobian)[0])


def linearise(
    R: Floats, t: Floats, points: Floats, rays: Rays, whiten: Floats
) -> tuple[Floats, Floats]:
    """Whitened residuals (B, 2N), infinite behind the camera, and derivatives (B, 2N, 6)."""
    turned = points @ np.swapaxes(R, -1, -2)
    seen = turned + t[:, None]
    depth = (rays.directions * seen).sum(axis=-1)
    in_front = depth > _NEAR * np.linalg.norm(seen, axis=-1)
    scale = np.where(in_front, depth, 1.0)
    residuals = (rays.to_pixels @ seen[..., None])[..., 0] / scale[..., None]
    by_point = rays.to_pixels - residuals[..., None] * rays.directions[..., None, :]
    by_point = by_point / scale[..., None, None]
    by_rotation = np.cross(turned[..., None, :], by_point)  # a . (w x b) = w . (b x a)
    several = len(t)
    jacobian = np.concatenate([by_point, by_rotation], axis=-1).reshape(several, -1, 6)
    whitened = (whiten @ residuals.reshape(several, -1, 1))[..., 0]
    return np.where(in_front.all(axis=1)[:, None], whitened, np.inf), whiten @ jacobian


def moved(R: Floats, t: Floats, step: Floats) -> tuple[Floats, Floats]:
    """Poses changed by (..., 6): translated by the first three, rotated by the others."""
    return turn(step[..., 3:]) @ R, t + step[..., :3]


def turn(rotation_vectors: npt.ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    halves = np.asarray(rotation_vectors, np.float64) / 2
    half = np.linalg.norm(halves, axis=-1, keepdims=True)
    imaginary = halves * np.sinc(half / np.pi)
    return rotations.to_matrix(np.concatenate([imaginary, np.cos(half)], axis=-1))


def _sum_of_squares(residuals: Floats) -> Floats:
    total: Floats = (residuals * residuals).sum(axis=-1)
    return np.where(np.isnan(total), np.inf, total)


def _normal_equations(residuals: Floats, jacobian: Floats) -> tuple[Floats, Floats]:
    finite = np.where(np.isfinite(residuals), residuals, 0.0)
    transposed = np.swapaxes(jacobian, -1, -2)
    return transposed @ jacobian, (transposed @ finite[..., None])[..., 0]


def _damped_step(information: Floats, slope: Floats, damping: Floats) -> Floats:
    """Damped step, scaled by the diagonal, so that units do not matter."""
    scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    scale = np.where(scale > 0, scale, 1.0)
    normed = information / scale[:, :, None] / scale[:, None, :]
    normed = normed + (damping + 1e-14)[:, None, None] * np.eye(6)
    finite = np.asarray(np.isfinite(normed).all(axis=(1, 2)))
    normed = np.where(finite[:, None, None], normed, np.eye(6))
    wanted: Floats = np.where(finite[:, None], -slope / scale, 0.0)
    step = np.asarray(np.linalg.solve(normed, wanted[..., None]), np.float64)
    return step[..., 0] / scale
