"""How exactly the corners of square tags were found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.borders import TYPICAL, Borders

_BLURS_HIGH = (9.9, 13.5, 15.6, 17.7, 19.8, 21.8, 23.9, 26, 28, 30.2, 32.2, 36.4, 41.6)
_SIGMAS_PX = (
    0.27,
    0.2,
    0.195,
    0.178,
    0.148,
    0.115,
    0.075,
    0.058,
    0.042,
    0.028,
    0.02,
    0.0125,
    0.0105,
)
"""Of AprilTag 3 at full resolution on rendered tags without noise, by height over blur."""
_BY_NOISE = 0.75
_NO_BLUR_PX = 0.2
_BY_ROWS, _RISE_PX = 0.045, 1.2
"""Edges along rows or columns of pixels are found worse: all along them errors are the same."""

_EXTRA_PX = np.array([0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 4.0])
"""What real lenses, prints, calibrations and motion may add."""
_PRIOR = np.array([0.99, *[0.01 / 8] * 8])


def corner_sigma(
    corners_uv: npt.ArrayLike, floor_px: float = 0.0, borders: Borders = TYPICAL
) -> Floats:
    """Standard deviations, in pixels, of each coordinate of squares' corners.

    Measured on 6,000 rendered tags with sides of 14 to 130 px, tilts to 60 degrees, blurs to 1.4 px
    and noise to a thirtieth of the contrast: `benchmarks/landmarks/poses.py`.

    Args:
        corners_uv: (..., 4, 2) pixels, in order around the square.
        floor_px: what a real camera adds, 0.3 is not rare; 0 of rendered images.
        borders: what the squares' borders look like, (...) each: `borders_of`.

    Returns:
        (...), NaN where corners are.
    """
    corners = np.asarray(corners_uv, np.float64)
    sides = np.roll(corners, -1, axis=-2) - corners
    first, second = corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    area = np.abs(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]) / 2
    longest = np.linalg.norm(sides, axis=-1).max(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / longest
        # a bit less where the square is slanted much
        blurs_high = height * (height / longest) ** 0.4 / (borders.blur_px + _NO_BLUR_PX)
        sharp = np.exp(np.interp(np.log(blurs_high), np.log(_BLURS_HIGH), np.log(_SIGMAS_PX)))
    noise = _BY_NOISE * borders.noise * np.sqrt(borders.blur_px)
    rise = np.abs(sides).min(axis=(-2, -1))  # of a side along rows or columns, in pixels
    by_rows = _BY_ROWS * borders.blur_px * np.exp(-rise / _RISE_PX)
    sigma: Floats = np.sqrt(sharp**2 + noise**2 + by_rows**2 + floor_px**2)
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
