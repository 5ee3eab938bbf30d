"""How exactly the corners of square tags were found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_HEIGHTS_PX = (8, 11, 13, 17, 21, 23.5, 26.5, 30, 34, 39, 46, 60, 100)
_SIGMAS_PX = (0.29, 0.21, 0.18, 0.165, 0.14, 0.11, 0.082, 0.051, 0.038, 0.027, 0.020, 0.0185, 0.017)
"""Of AprilTag 3 at full resolution on rendered tags: `benchmarks/landmarks/poses.py --corners`."""

_EXTRA_PX = np.array([0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0])
"""What real lenses, prints, calibrations and motion may add."""
_PRIOR = np.array([0.95, *[0.05 / 7] * 7])


def corner_sigma(corners_uv: npt.ArrayLike, floor_px: float = 0.0) -> Floats:
    """Standard deviations, in pixels, of each coordinate of squares' corners.

    Args:
        corners_uv: (..., 4, 2) pixels, in order around the square.
        floor_px: what a real camera adds, near 0.3; 0 of rendered images.

    Returns:
        (...) by the square's height in pixels: its area by its longest side.
    """
    corners = np.asarray(corners_uv, np.float64)
    sides = np.roll(corners, -1, axis=-2) - corners
    first, second = corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    area = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / np.linalg.norm(sides, axis=-1).max(axis=-1)
        logs = np.interp(np.log(height), np.log(_HEIGHTS_PX), np.log(_SIGMAS_PX))
    sigma: Floats = np.hypot(np.exp(logs), floor_px)
    return sigma


def with_extra(sigma_px: Floats, chi2: Floats) -> Floats:
    """Standard deviations, those of one image, in the light of how well poses fit the corners.

    One noise more, the same for all corners of an image, is weighed by the residuals that are
    left: those of a rendered tag are small, and those of a camera's are as large as its lens and
    calibration make them. The more tags there are, the surer that is.

    Args:
        sigma_px: (B, N) of N corners of each of B bodies, by their size alone.
        chi2: (B,) sums of the squared residuals by those; what is not finite does not count.

    Returns:
        (B, N) roots of the expected variances, over `_EXTRA_PX` with `_PRIOR`.
    """
    left = 2 * sigma_px.shape[1] - 6  # numbers more than a pose has
    fits = np.isfinite(chi2)
    variance = (sigma_px[fits] ** 2).mean(axis=1)[:, None]
    raised = variance + _EXTRA_PX**2
    log_likelihood = -(chi2[fits, None] * variance / raised + left * np.log(raised)) / 2
    log_weight = np.log(_PRIOR) + log_likelihood.sum(axis=0)
    weight = np.exp(log_weight - log_weight.max())
    extra = (weight * _EXTRA_PX**2).sum() / weight.sum()
    raised_sigma: Floats = np.sqrt(sigma_px**2 + extra)
    return raised_sigma
