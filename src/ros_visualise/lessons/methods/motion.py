"""Two views of a camera that moves: corners, optical flow, epipolar lines, depths."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.estimation.visual.bundle import triangulated
from ros_visualise.estimation.visual.starting import FirstMotion
from ros_visualise.lessons.methods.sobel import sobel

_LEAST = 12  # corners that locate a view
_PER_LEVEL = 8  # of Sobel's kernel, which adds up so many differences


def eigenvalues(gray: Pixels) -> tuple[Floats, Floats]:
    """The lesser and the greater eigenvalue of each pixel's matrix of derivatives.

    That matrix is the sum of [Ix^2, Ix Iy; Ix Iy, Iy^2] over 3 x 3 pixels; derivatives are in
    levels per pixel.

    Source: J. Shi, C. Tomasi, Good features to track, CVPR 1994.
    """
    dx, dy = (one / _PER_LEVEL for one in sobel(gray, 3))
    xx, xy, yy = (cv2.boxFilter(one, -1, (3, 3), normalize=False, borderType=cv2.BORDER_REPLICATE)
                  for one in (dx * dx, dx * dy, dy * dy))  # fmt: skip
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.maximum(middle - half, 0.0), middle + half


def flow_step(before: Pixels, after: Pixels, corner_uv: Floats, side: int) -> Floats:
    """The motion (2,) of the patch around a corner, pixels, by one step of Lucas and Kanade.

    Args:
        before, after: gray pictures.
        corner_uv: (2,) in the first.
        side: of the patch, pixels.

    Source: B. Lucas, T. Kanade, An iterative image registration technique, 1981.
    """
    size = (side + 2, side + 2)
    place = (float(corner_uv[0]), float(corner_uv[1]))
    first, second = (
        cv2.getRectSubPix(one.astype(np.float32), size, place) for one in (before, after)
    )
    dx = (first[1:-1, 2:] - first[1:-1, :-2]).ravel() / 2
    dy = (first[2:, 1:-1] - first[:-2, 1:-1]).ravel() / 2
    later = (second - first)[1:-1, 1:-1].ravel()
    A = np.stack([dx, dy], axis=1).astype(np.float64)
    found = np.linalg.lstsq(A, -later.astype(np.float64), rcond=None)[0]
    return np.asarray(found, np.float64)


def essential(R: Floats, t: Floats) -> Floats:
    """E = [t]x R of a motion T_second_first, so that second' E first = 0 for directions."""
    x, y, z = t
    found: Floats = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ R
    return found


def epipolar_lines(E: Floats, K: Floats, pixels_uv: Floats) -> Floats:
    """The lines (N, 3) in the second picture on which pixels (N, 2) of the first must be.

    A line is a u + b v + c = 0 with a^2 + b^2 = 1, so that it gives distances in pixels.
    """
    back = np.linalg.inv(K)
    lines = np.column_stack([pixels_uv, np.ones(len(pixels_uv))]) @ (back.T @ E @ back).T
    scaled: Floats = lines / np.maximum(np.linalg.norm(lines[:, :2], axis=1), 1e-12)[:, None]
    return scaled


def distances(lines: Floats, pixels_uv: Floats) -> Floats:
    """(N,) distances of pixels (N, 2) from lines (N, 3), pixels."""
    away: Floats = np.abs((lines[:, :2] * pixels_uv).sum(axis=1) + lines[:, 2])
    return away


def clipped(line: Floats, width: int, height: int) -> Floats | None:
    """The part of a line (3,) in a picture: its two ends (2, 2); None if it is outside."""
    high = np.array([width - 1.0, height - 1.0])
    foot = high / 2 - (line[:2] @ high / 2 + line[2]) * line[:2]
    along = np.array([-line[1], line[0]])
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    ends = np.sort([(0 - foot) / along, (high - foot) / along], axis=0)
    first, last = ends[0].max(), ends[1].min()
    return foot + np.outer([first, last], along) if first < last else None


def rays_at(K: Floats, pixels_uv: Floats) -> Floats:
    """Directions (N, 2) of pixels (N, 2), at z = 1."""
    found: Floats = (pixels_uv - K[:2, 2]) / [K[0, 0], K[1, 1]]
    return found


def misfit(motion: FirstMotion, first: Floats, between: Floats, second: Floats) -> float:
    """Median distance between where a third view sees corners and where the motion puts them.

    Args:
        motion: from the first to the second view.
        first, between, second: directions (N, 2) of the same corners in the three views.

    Returns:
        In units of directions; infinity if too few corners get a depth.
    """
    inverse, _ = triangulated(motion.R, motion.t, first, second)
    good = inverse > 1e-6
    if good.sum() < _LEAST:
        return np.inf
    points = np.column_stack([first, np.ones(len(first))])[good] / inverse[good, None]
    _, turn, shift = cv2.solvePnP(points, between[good], np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    seen = cv2.projectPoints(points, turn, shift, np.eye(3), None)[0][:, 0]
    return float(np.median(np.linalg.norm(seen - between[good], axis=1)))


@dataclass(frozen=True, eq=False)
class ViewPair:
    """Corners (N, 2) of two views without distortion, and the motion between these."""

    K: Floats
    first_uv: Floats
    second_uv: Floats
    motion: FirstMotion

    def depths(self) -> tuple[Floats, Floats]:
        """Depths in the first view, and what one pixel changes of each, as a fraction."""
        first, second = (rays_at(self.K, uv) for uv in (self.first_uv, self.second_uv))
        inverse, factor = triangulated(self.motion.R, self.motion.t, first, second)
        good = self.motion.agree & (inverse > 1e-6)
        z: Floats = np.where(good, 1 / np.where(good, inverse, 1.0), np.nan)
        return z, z * factor / self.K[0, 0]


NO_PAIR = ViewPair(np.eye(3), np.zeros((0, 2)), np.zeros((0, 2)),
                 FirstMotion(np.eye(3), np.zeros(3), np.zeros(0, bool)))  # fmt: skip
