"""The first motion of a camera, by two views, up to its scale.

Corners of a plane, such as the ground below a drone, fit with two motions, which a third view tells
apart: so this gives all motions that are possible.

Source: D. Nister, An efficient solution to the five-point relative pose problem, 2004; O. Faugeras,
F. Lustman, Motion and structure from motion in a piecewise planar environment, 1988.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.bundle import Mask

STILL = "waiting for motion"
_LEAST = 30  # corners in both views
_AGREED = 0.5  # of them
_PARALLAX = 0.015  # rad, that of near corners: what is left when the rotation is taken out
_OFF = 2.5  # standard deviations of directions
_OFF_PLANE = 4.0  # the same: what turns and comes closer is followed less exactly
_AT_REST = 2.0  # standard deviations of directions
_RESTING = 0.3  # of the corners, if the camera is at rest and things move
_PLANE = 0.9  # of the corners on it, if the scene is a plane; far ones are on one, too
_IN_FRONT = 0.95
_TRIALS = 100  # samples: 96% of motions that half of the corners agree with are found
_CELLS = 4  # in each direction, of the part of the image with corners
_COVERED = 0.3  # of these cells, that show near corners: fewer are things that move


class FirstMotion(NamedTuple):
    """T_second_first with |t| = 1, and which corners agree (N,)."""

    R: Floats
    t: Floats
    agree: Mask


def first_motions(first: Floats, second: Floats, sigma: float) -> list[FirstMotion] | str:
    """The motions between two views by directions (N, 2) of the same corners, or why none."""
    if len(first) < _LEAST:
        return "too few corners"
    if (np.linalg.norm(second - first, axis=1) < _AT_REST * sigma).mean() > _RESTING:
        return STILL
    reason, found = "no motion fits", []
    for R, t, agree in (*_of_points(first, second, sigma), *_of_a_plane(first, second, sigma)):
        turned = first @ R[:, :2].T + R[:, 2]
        away = np.linalg.norm(second - turned[:, :2] / turned[:, 2:], axis=1)
        is_near = away > max(_PARALLAX, 4 * sigma)
        if agree.mean() < _AGREED:
            is_moving = is_near.mean() > _COVERED
            reason = "moving objects fill most of the image" if is_moving else STILL
        elif _cells(first, agree & is_near) < _COVERED * _cells(first, agree):
            reason = STILL
        else:
            found.append(FirstMotion(R, t, agree))
    return found or reason


def _of_points(first: Floats, second: Floats, sigma: float) -> Iterator[FirstMotion]:
    """The motion by corners at any depths."""
    E, found = cv2.findEssentialMat(
        first, second, np.eye(3), cv2.RANSAC, 0.999, _OFF * sigma, _TRIALS
    )
    if E is not None and E.shape == (3, 3):
        _, R, t, agree = cv2.recoverPose(E, first, second, np.eye(3), mask=found)
        yield FirstMotion(np.asarray(R, float), np.asarray(t, float)[:, 0], agree[:, 0] > 0)


def _of_a_plane(first: Floats, second: Floats, sigma: float) -> Iterator[FirstMotion]:
    """The motions by corners of a plane that is seen by both views."""
    H, found = cv2.findHomography(
        first, second, cv2.USAC_MAGSAC, _OFF_PLANE * sigma, maxIters=_TRIALS
    )
    if H is None or found.mean() < _PLANE:
        return
    agree = found[:, 0] > 0
    rays = np.insert(first[agree], 2, 1.0, axis=1)
    count, rotations, shifts, normals = cv2.decomposeHomographyMat(H, np.eye(3))
    for R, t, n in zip(rotations[:count], shifts[:count], normals[:count], strict=True):
        if np.linalg.norm(t) > _PARALLAX and (rays @ n > 0).mean() > _IN_FRONT:
            direction = np.asarray(t, float)[:, 0] / np.linalg.norm(t)
            yield FirstMotion(np.asarray(R, float), direction, agree)


def _cells(rays: Floats, chosen: Mask) -> int:
    """Number of cells of a grid over all directions with some of the chosen ones."""
    low, high = rays.min(axis=0), rays.max(axis=0)
    places = ((rays[chosen] - low) / (high - low + 1e-9) * _CELLS).astype(int)
    return len({*map(tuple, places.tolist())})
