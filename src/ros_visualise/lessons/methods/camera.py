"""The model of a camera with a pinhole and a lens."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.data import Floats

BOARD = (9, 6)
"""Corners of a chessboard, across and down."""
_SQUARE_M = 0.03


def camera_matrix(focal_px: float, width: int, height: int) -> Floats:
    """K (3, 3) of a camera with its principal point in the image centre."""
    center_x, center_y = (width - 1) / 2, (height - 1) / 2
    return np.array([[focal_px, 0, center_x], [0, focal_px, center_y], [0, 0, 1]])


def project(points_xyz: Floats, K: Floats) -> Floats:
    """Pixels (N, 2) of points (N, 3) in front of the camera: u = fx X/Z + cx, v = fy Y/Z + cy."""
    seen = points_xyz @ K.T
    pixels: Floats = seen[:, :2] / seen[:, 2:]
    return pixels


def distort(rays_xy: Floats, D: Floats) -> Floats:
    """Rays (N, 2) of X/Z and Y/Z after a lens.

    Args:
        rays_xy: without a lens.
        D: k1, k2, p1, p2 and k3: radial, and tangential for a decentred lens.

    Source: Brown, Decentering distortion of lenses, 1966; OpenCV's calib3d.
    """
    k1, k2, p1, p2, k3 = D
    x, y = rays_xy.T
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    moved_x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    moved_y = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return np.stack([moved_x, moved_y], axis=1)


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """Estimated fx, fy, cx, cy, k1, k2, p1, p2, k3, and their standard deviations (9,)."""

    values: Floats
    deviations: Floats
    rms_px: float
    views: list[Floats]
    """(N, 2) measured pixels each."""


def calibrate(
    K: Floats, D: Floats, size: tuple[int, int], views: int, noise_px: float, seed: int
) -> CalibrationResult:
    """Calibrate a known camera from simulated images of a board.

    Args:
        K, D: the camera.
        size: (width, height) of its images.
        views: number of images.
        noise_px: standard deviation of a corner's coordinates.
        seed: of the board's poses, and of the noise.
    """
    random = np.random.default_rng(seed)
    board = np.zeros((BOARD[0] * BOARD[1], 3))
    board[:, :2] = np.mgrid[: BOARD[0], : BOARD[1]].T.reshape(-1, 2) * _SQUARE_M
    board -= board.mean(axis=0)
    seen = [_view(board, K, D, size, random) for _ in range(views)]
    noisy = [one + random.normal(0, noise_px, one.shape) for one in seen]
    points = [board.astype(np.float32)] * views
    pixels = [one.astype(np.float32)[:, None] for one in noisy]
    rms, matrix, lens, _, _, deviations, *_ = cv2.calibrateCameraExtended(
        points, pixels, size, np.eye(3), np.zeros(5)
    )
    values = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *lens.ravel()[:5]])
    return CalibrationResult(values, np.asarray(deviations, float).ravel()[:9], float(rms), noisy)


def _view(
    board: Floats, K: Floats, D: Floats, size: tuple[int, int], random: np.random.Generator
) -> Floats:
    """(N, 2) pixels of the board, tilted, somewhere in the image."""
    R, _ = cv2.Rodrigues(random.uniform(-0.6, 0.6, 3))
    depth = K[0, 0] * BOARD[0] * _SQUARE_M / (random.uniform(0.35, 0.6) * size[0])
    middle = np.array(size) * random.uniform(0.3, 0.7, 2)
    place = np.append((middle - K[:2, 2]) / K[0, 0], 1) * depth
    points = board @ R.T + place
    rays = distort(points[:, :2] / points[:, 2:], D)
    return rays * K[[0, 1], [0, 1]] + K[:2, 2]
