"""Initial poses of a body: both readings of the image of a flat body."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.refinement import turn

_FLAT = 1e-6  # largest distance of points from a plane, as a fraction of the extent
_EYE = np.eye(3)
_WIDEST = 0.1  # cosine of the largest angle from the body's centre given to OpenCV


def starts(points: Floats, directions: Floats) -> dict[int, tuple[Floats, Floats]]:
    """Two poses each, R (2, 3, 3) and t (2, 3), of those of B bodies that have any.

    Only perspective distinguishes them: from afar, a square seen from the left looks like one seen
    from the right.

    Args:
        points: (B, N, 3) metres.
        directions: (B, N, 3) of their rays; NaN if unknown.

    Source: T. Collins, A. Bartoli, Infinitesimal Plane-Based Pose Estimation, 2014; for bodies that
    are not flat G. Terzakis, M. Lourakis, A Consistently Fast and Globally Optimal Solution to the
    Perspective-n-Point Problem, 2020. The other reading: D. Oberkampf, D. DeMenthon, L. Davis,
    Iterative Pose Estimation Using Coplanar Feature Points, 1996.
    """
    ahead = directions.mean(axis=1)
    to_ahead = _turns_to_z(ahead)
    local = directions @ np.swapaxes(to_ahead, 1, 2)
    middles = points.mean(axis=1)
    centred = points - middles[:, None]
    extents, axes = np.linalg.svd(centred)[1:]
    in_view = np.asarray((local[..., 2] > _WIDEST).all(axis=1))
    usable = in_view & (extents[:, 1] > _FLAT * extents[:, 0])  # not collinear
    is_flat = extents[:, 2] <= _FLAT * extents[:, 0]
    found = {}
    for body in np.flatnonzero(usable):
        plane = np.ascontiguousarray(local[body, :, :2] / local[body, :, 2:])
        method = cv2.SOLVEPNP_IPPE if is_flat[body] else cv2.SOLVEPNP_SQPNP
        first = _solve(centred[body], plane, method)
        if first is not None:
            R, t = to_ahead[body].T @ first[0], to_ahead[body].T @ first[1]
            both = np.stack([R, _mirror(t) @ R @ _mirror(axes[body, 2])])
            found[int(body)] = both, t - both @ middles[body]
    return found


def _solve(points: Floats, plane: Floats, method: int) -> tuple[Floats, Floats] | None:
    try:
        done, turned, t, _ = cv2.solvePnPGeneric(points, plane, _EYE, None, flags=method)
    except cv2.error:
        return None
    if not done or not np.isfinite([turned[0], t[0]]).all():
        return None
    return np.asarray(cv2.Rodrigues(turned[0])[0], np.float64), np.asarray(t[0].ravel(), np.float64)


def _turns_to_z(directions: Floats) -> Floats:
    """(B, 3, 3) shortest rotations of directions (B, 3) to the z axis."""
    x, y, z = directions.T
    sine = np.hypot(x, y)
    axes = np.stack([y, -x, np.zeros_like(x)], axis=1) / np.where(sine > 0, sine, 1)[:, None]
    return turn(np.where(np.isfinite(axes), axes, 0) * np.nan_to_num(np.arctan2(sine, z))[:, None])


def _mirror(normal: Floats) -> Floats:
    mirror: Floats = _EYE - 2 * np.outer(normal, normal) / (normal @ normal)
    return mirror
