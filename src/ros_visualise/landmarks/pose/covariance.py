"""Covariance of refined poses, and of two readings merged into one."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.rays import Rays
from ros_visualise.landmarks.pose.refinement import RefinedPoses, linearise, moved

_RIDGE = 1e-13  # added to the scaled information, for unobservable directions


def covariances(fit: RefinedPoses, points: Floats, rays: Rays, whiten: Floats) -> Floats:
    """(B, 6, 6) of refined poses; arguments as in `refinement.refine`.

    To first order, the covariance is the inverse of the information. For a tag facing the camera,
    the information on its tilt depends on the tilt itself, which is uncertain. So the information
    is averaged over possible true poses: sqrt(2) standard deviations to both sides along the two
    least certain rotations.

    Source: S. Julier, J. Uhlmann, Unscented Filtering and Nonlinear Estimation, 2004 (the points).
    """
    central = _inverse(fit.information)
    variances, axes = np.linalg.eigh(central[:, 3:, 3:])
    around = []
    for worst in (1, 2):
        deviation = central[:, :, 3:] @ axes[:, :, worst, None] / _root(variances[:, worst])
        for side in (-np.sqrt(2), np.sqrt(2)):
            R, t = moved(fit.R, fit.t, side * deviation[..., 0])
            _, jacobian = linearise(R, t, points, rays, whiten)
            there = _inverse(np.swapaxes(jacobian, -1, -2) @ jacobian)
            around.append(np.where(np.isfinite(there), there, central))
    mean: Floats = np.mean(around, axis=0)
    return mean


def difference(R_a: Floats, t_a: Floats, R_b: Floats, t_b: Floats) -> Floats:
    """The six numbers that change pose a into b: see `refinement.moved`."""
    turned, _ = cv2.Rodrigues(R_b @ R_a.T)
    return np.concatenate([t_b - t_a, np.asarray(turned, np.float64).ravel()])


def _root(variances: Floats) -> Floats:
    root: Floats = np.sqrt(variances)[:, None, None]
    return root


def _inverse(information: Floats) -> Floats:
    scale = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        normed = information / scale[:, :, None] / scale[:, None, :]
    known = np.asarray(np.isfinite(normed).all(axis=(1, 2)))[:, None, None]
    normed = np.where(known, normed, np.eye(6)) + _RIDGE * np.eye(6)
    inverse = np.asarray(np.linalg.inv(normed), np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = inverse / scale[:, :, None] / scale[:, None, :]
    return np.where(known, inverse, np.nan)
