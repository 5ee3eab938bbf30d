"""The height of a camera over the ground, in units of its own motion.

A plane n'x = d in front of the first of two views takes its image to the second by a homography.
Patches of the ground are followed from the first image, warped by it as the plane is known so far,
to the second: so they look alike in both even where the road passes close below. Each match is
linear in n / d, the plane that is sought, whose length is one by the height.

Source: R. Hartley, A. Zisserman, Multiple View Geometry, 2004, section 13.1 (the homography); S.
Song, M. Chandraker, Robust scale estimation in real-time monocular SFM, CVPR 2014.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels
from ros_visualise.vision.tracking import flow

_STEP = 1 / 120  # of the image's width, between patches
_FARTHEST = 10.0  # heights along the ground, from below the camera
_WIDEST = 2.5  # heights to each side
_LEAST = 25  # patches that agree
_AGREED = 0.3  # of the patches that moved enough, at least
_LEAST_PX = 1.0  # of the motion by parallax
_OFF_PX = 1.5
_SHARED = 25  # matches of neighbouring patches that are as good as one


@dataclass(frozen=True, eq=False)
class SeenGround:
    """A plane ``m'x = 1`` in the axes of a camera, m (3,), and the covariance of m (3, 3).

    ``patches``: number of those that showed it.
    """

    m: Floats
    covariance: Floats
    patches: int = 0

    @property
    def height(self) -> float:
        """KeyframeDistance of the camera."""
        return 1 / float(np.linalg.norm(self.m))

    @property
    def height_sigma(self) -> float:
        """Standard deviation of the height."""
        n = self.m / np.linalg.norm(self.m)
        return float(np.sqrt(n @ self.covariance @ n)) * self.height**2

    @property
    def normal(self) -> Floats:
        """(3,) unit vector to the ground."""
        normal: Floats = self.m * self.height
        return normal


def find_ground(
    before: Pixels,
    gray: Pixels,
    K: Floats,
    R: Floats,
    t: Floats,
    guess: SeenGround,
    steps: int = 3,
) -> SeenGround | None:
    """The ground plane in the axes of the first view; None if too little of it is seen to move.

    Args:
        before, gray: both images, undistorted.
        K: (3, 3) of both.
        R, t: T_second_first.
        guess: the plane as far as it is known, a prior on its normal.
    """
    m = guess.m
    found = None
    for _ in range(steps):
        pixels = _patches(gray.shape, K, m)
        if len(pixels) < _LEAST:
            return found
        matched = _match(before, gray, K, R, t, m, pixels)
        if matched is None:
            return found
        found = _fit(K, R, t, m, guess, *matched)
        if found is None:
            return None
        m = found.m
    return found


def _patches(shape: tuple[int, ...], K: Floats, m: Floats) -> Floats:
    """(N, 2) pixels of a grid where the ground is near."""
    height, width = shape[:2]
    step = max(int(width * _STEP), 8)
    margin = 12
    grid = np.mgrid[margin : width - margin : step, margin : height - margin : step]
    pixels = grid.reshape(2, -1).T.astype(np.float64)
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(K).T
    down = rays @ m
    points = rays / np.where(down > 1e-9, down, np.inf)[:, None] * np.linalg.norm(m)
    n = m / np.linalg.norm(m)
    flat = points - n  # along the ground, in heights
    ahead = np.linalg.norm(flat, axis=1)
    side = np.cross([0.0, 0, 1], n)  # for a camera that looks ahead; else all sides are alike
    near = (down > 1e-9) & (ahead < _FARTHEST) & (np.abs(flat @ side) < _WIDEST)
    chosen: Floats = pixels[near]
    return chosen


def _match(
    before: Pixels, gray: Pixels, K: Floats, R: Floats, t: Floats, m: Floats, pixels: Floats
) -> tuple[Floats, Floats] | None:
    """Pixels of patches (N, 2) in both images, which moved enough by parallax."""
    inverse = np.linalg.inv(K)
    H = K @ (R + np.outer(t, m)) @ inverse
    H_far = K @ R @ inverse
    there, far = _warp(H, pixels), _warp(H_far, pixels)
    height, width = gray.shape
    inside = (there > 12).all(axis=1) & (there < [width - 12, height - 12]).all(axis=1)
    moved = np.linalg.norm(there - far, axis=1) > _LEAST_PX
    kept = inside & moved
    if kept.sum() < _LEAST:
        return None
    warped = cv2.warpPerspective(before, H, (width, height))
    ends, found = flow(warped, gray, there[kept], there[kept], levels=1, back_levels=0)
    return pixels[kept][found], ends[found]


def _warp(H: Floats, pixels: Floats) -> Floats:
    moved = np.column_stack([pixels, np.ones(len(pixels))]) @ H.T
    z = np.where(moved[:, 2:] > 1e-6, moved[:, 2:], np.inf)
    return np.where(np.isfinite(z), moved[:, :2] / z, -1.0)


def _fit(
    K: Floats,
    R: Floats,
    t: Floats,
    m: Floats,
    guess: SeenGround,
    pixels: Floats,
    ends: Floats,
) -> SeenGround | None:
    """The plane that fits matches, by iteratively reweighted least squares."""
    if len(pixels) < _LEAST:
        return None
    focal = float(K[0, 0])
    inverse = np.linalg.inv(K)
    x = np.column_stack([pixels, np.ones(len(pixels))]) @ inverse.T
    y = (np.column_stack([ends, np.ones(len(ends))]) @ inverse.T)[:, :2]
    turned = x @ R.T
    # (turned + t s)[:2] = y (turned + t s)[2], s = m'x
    by_s = t[:2] - y * t[2]
    left = y * turned[:, 2:] - turned[:, :2]
    depth = turned[:, 2] + t[2] * (x @ m)  # what the equation is too long by
    A = (by_s[..., None] * x[:, None]) / depth[:, None, None]
    b = left / depth[:, None]
    prior = np.linalg.inv(guess.covariance)
    sigma = _OFF_PX / 2 / focal
    used = np.ones(len(b), bool)
    for _ in range(8):
        off = np.linalg.norm(b - A @ m, axis=1)
        w = 1 / (1 + (off / sigma) ** 2) ** 2 / sigma**2
        weighted = (A * (w / _SHARED)[:, None, None]).reshape(-1, 3).T
        H = weighted @ A.reshape(-1, 3) + prior
        g = weighted @ b.ravel() + prior @ guess.m
        m = np.linalg.solve(H, g)
        used = np.linalg.norm(b - A @ m, axis=1) < _OFF_PX / focal
        if used.sum() < _LEAST:
            return None
        spread = np.median(np.linalg.norm((b - A @ m)[used], axis=1)) / 1.1774
        sigma = max(float(spread), 0.1 / focal) * 2
    if used.mean() < _AGREED or not np.isfinite(m).all():
        return None
    return SeenGround(m, np.linalg.inv(H), int(used.sum()))
