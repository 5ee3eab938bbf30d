"""Accuracy of the corners of square tags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats

_BY_HEIGHT = (
    (9, 11, 13, 15.5, 18.5, 22, 26, 31, 37, 45, 90),
    (0.3, 0.24, 0.21, 0.205, 0.165, 0.11, 0.071, 0.043, 0.026, 0.021, 0.018),
)
"""Side in pixels -> standard deviation in pixels, for AprilTag 3 on rendered tags."""


@dataclass(frozen=True)
class CameraError:
    """Standard deviations of the errors of a real camera and its calibration.

    Args:
        floor_px: of each coordinate of a corner, as long as images do not show it: often 0.3; 0
            for rendered images.
        focal: of the focal lengths, as a fraction.
        center_px: of the principal point.
    """

    floor_px: float = 0.0
    focal: float = 0.0
    center_px: float = 0.0

    @property
    def is_calibrated_exactly(self) -> bool:
        return self.focal == 0 and self.center_px == 0

    def of_calibration(self, corners_uv: Floats, info: CameraInfo) -> Floats:
        """(B, 2N, 2N) covariance of corners (B, N, 2) due to the calibration, common to a body."""
        away = self.focal * (corners_uv - info.K[:2, 2])
        shift = np.broadcast_to(self.center_px * np.eye(2), (*corners_uv.shape, 2))
        by = np.concatenate([away[..., None], shift], axis=-1).reshape(len(corners_uv), -1, 3)
        noise: Floats = by @ np.swapaxes(by, 1, 2)
        return noise


EXACT = CameraError()


def corner_sigma(corners_uv: npt.ArrayLike) -> Floats:
    """Standard deviations, in pixels, of the coordinates of AprilTag 3 corners.

    Args:
        corners_uv: (..., 4, 2) pixels, in order around the square.

    Returns:
        (...), NaN where corners are NaN.
    """
    corners = np.asarray(corners_uv, np.float64)
    sides = np.roll(corners, -1, axis=-2) - corners
    first, second = corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    area = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / np.linalg.norm(sides, axis=-1).max(axis=-1)
        logs = np.interp(np.log(height), *np.log(_BY_HEIGHT))
    sigma: Floats = np.exp(logs)
    return sigma


def corner_noise(
    corners_uv: npt.ArrayLike, floor_px: float = 0.0, known_px2: npt.ArrayLike | None = None
) -> Floats:
    """Covariances (T, 8, 8) of u and v of the first corner of T squares, of the second, and so on.

    Args:
        corners_uv: (T, 4, 2) pixels.
        floor_px: error of a real camera, often 0.3; 0 for rendered images.
        known_px2: (T, 8, 8) reported by the detector; NaN if unknown: use `corner_sigma`.
    """
    floor = floor_px**2 * np.eye(8)
    if known_px2 is None:
        return corner_sigma(corners_uv)[:, None, None] ** 2 * np.eye(8) + floor
    known = np.array(known_px2, np.float64)
    unknown = ~np.isfinite(known).all(axis=(1, 2))
    if unknown.any():
        known[unknown] = corner_noise(np.asarray(corners_uv)[unknown])
    return known + floor


def whitening(noise_px2: Floats) -> Floats:
    """(B, K, K) matrices that give K numbers of covariances (B, K, K) unit variance."""
    known = np.isfinite(noise_px2).all(axis=(1, 2), keepdims=True)
    usable = np.where(known, noise_px2, np.eye(noise_px2.shape[1]))
    whiten = np.asarray(np.linalg.inv(np.linalg.cholesky(usable)), np.float64)
    return np.where(known, whiten, np.nan)
