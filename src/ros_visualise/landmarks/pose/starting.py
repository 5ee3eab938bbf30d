"""Where to begin the search for a body's pose: both readings of a flat body's picture."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.refinement import turn

_FLAT = 1e-6  # of a body's extent, that its points are out of a plane
_WIDEST = 0.1  # cosine of the angle from the body's centre beyond which OpenCV is not asked


def starts(points: Floats, directions: Floats) -> tuple[Floats, Floats] | None:
    """Two poses, R (2, 3, 3) and t (2, 3), of N points (N, 3) seen in directions (N, 3).

    They are told from one another by perspective alone: at a distance a square seen from the left
    looks as one seen from the right does. None where there is no pose.

    Source: T. Collins, A. Bartoli, Infinitesimal Plane-Based Pose Estimation, 2014; for bodies
    that are not flat G. Terzakis, M. Lourakis, A Consistently Fast and Globally Optimal Solution
    to the Perspective-n-Point Problem, 2020. The other reading: D. Oberkampf, D. DeMenthon,
    L. Davis, Iterative Pose Estimation Using Coplanar Feature Points, 1996.
    """
    ahead = directions.mean(axis=0)
    length = np.linalg.norm(ahead)
    if not length > _WIDEST:
        return None
    to_ahead = _turn_to_z(ahead / length)
    local = directions @ to_ahead.T
    if not (local[:, 2] > _WIDEST).all():
        return None
    middle = points.mean(axis=0)
    extent, axes = np.linalg.svd(points - middle)[1:]
    if not extent[1] > _FLAT * extent[0]:
        return None  # all on one line
    is_flat = extent[2] <= _FLAT * extent[0]
    method = cv2.SOLVEPNP_IPPE if is_flat else cv2.SOLVEPNP_SQPNP
    flat = np.ascontiguousarray(local[:, :2] / local[:, 2:])
    try:
        found = cv2.solvePnPGeneric(points - middle, flat, np.eye(3), None, flags=method)
    except cv2.error:
        return None
    if not found[0] or not np.isfinite([found[1][0], found[2][0]]).all():
        return None
    R, t = to_ahead.T @ turn(found[1][0].ravel()), to_ahead.T @ found[2][0].ravel()
    sight = t / np.linalg.norm(t)
    other = _mirror(sight) @ R @ _mirror(axes[2])
    both = np.stack([R, other])
    return both, t - both @ middle


def _turn_to_z(direction: Floats) -> Floats:
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, direction[2])
    return turn(axis / sine * angle if sine > 0 else np.array([angle, 0.0, 0.0]))


def _mirror(normal: Floats) -> Floats:
    mirror: Floats = np.eye(3) - 2 * np.outer(normal, normal)
    return mirror
