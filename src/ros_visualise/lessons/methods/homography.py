"""The homography between a plane and its picture, from at least four points."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats


def homography(points: Floats, pixels: Floats) -> Floats:
    """H (3, 3) from points (N, 2) of a plane to pixels (N, 2); its last number is 1.

    Two equations for each of at least four points; the solution is the last right singular vector.

    Source: Hartley, Zisserman, Multiple View Geometry, 2004, algorithm 4.1 (DLT).
    """
    rows = []
    for (x, y), (u, v) in zip(points, pixels, strict=True):
        rows.append([x, y, 1, 0, 0, 0, -u * x, -u * y, -u])
        rows.append([0, 0, 0, x, y, 1, -v * x, -v * y, -v])
    H = np.linalg.svd(np.array(rows, float))[2][-1].reshape(3, 3)
    scaled: Floats = H / H[2, 2]
    return scaled


def apply(H: Floats, points: Floats) -> Floats:
    """Points (N, 2) mapped by a homography."""
    moved = np.column_stack([points, np.ones(len(points))]) @ H.T
    pixels: Floats = moved[:, :2] / moved[:, 2:]
    return pixels


def ellipse(covariance: Floats, deviations: float, points: int = 60) -> Floats:
    """The line (N, 2) around zero at a number of standard deviations.

    Args:
        covariance: (2, 2).
        deviations: 1 contains 39 % of a normal distribution, 2 contain 86 %.
        points: N.
    """
    variances, axes = np.linalg.eigh(covariance)
    angle = np.linspace(0, 2 * np.pi, points)
    circle = np.stack([np.cos(angle), np.sin(angle)])
    line: Floats = (axes @ (np.sqrt(np.maximum(variances, 0))[:, None] * circle)).T * deviations
    return line
