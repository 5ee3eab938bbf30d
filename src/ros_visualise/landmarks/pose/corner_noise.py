"""How exactly the corners of square tags were found."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.landmarks.pose.borders import TYPICAL, Borders

_FITTED = (
    (18, 21, 23, 25.6, 28, 30.2, 33.6, 38, 43, 50, 66, 110),
    (0.2, 0.184, 0.15, 0.11, 0.075, 0.055, 0.037, 0.023, 0.017, 0.0125, 0.0085, 0.0065),
)
"""Height over blur -> pixels, on rendered tags without noise, where `tags.sides` fits the sides."""
_RAW = (
    (9.5, 13, 15, 17, 19, 21, 23, 25, 27),
    (0.27, 0.205, 0.198, 0.178, 0.148, 0.12, 0.08, 0.06, 0.045),
)
"""The same of AprilTag alone."""
_FITTED_HIGH_PX = 16.0
_BY_NOISE = 0.52
_BY_ROWS, _MOST_HIGH, _RISE_PX = 2.0, 60.0, 1.2
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
    rise = np.abs(sides).min(axis=(-2, -1))  # of a side along rows or columns, in pixels
    longest = np.linalg.norm(sides, axis=-1).max(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = area / longest
        slanted = height * (height / longest) ** 0.25
    fitted = _look_up(_FITTED, slanted / np.maximum(borders.blur_px - 0.15, 0.2))
    raw = _look_up(_RAW, slanted / (borders.blur_px + 0.2))
    sharp = np.where(height < _FITTED_HIGH_PX, raw, fitted)
    high = np.clip(slanted / (borders.blur_px + 0.2), 1, _MOST_HIGH)
    by_rows = _BY_ROWS / high * np.exp(-rise / _RISE_PX)
    noise = _BY_NOISE * borders.noise * np.sqrt(borders.blur_px)
    by_slant = 1 + 2 * np.maximum(0.65 - height / longest, 0)  # seen under 50 degrees and more
    found = by_slant * np.sqrt(sharp**2 + noise**2 + by_rows**2)
    sigma: Floats = np.hypot(found, floor_px)
    return sigma


def _look_up(table: tuple[tuple[float, ...], tuple[float, ...]], values: Floats) -> Floats:
    """Between the table's lines, by logarithms; at its ends the last ones."""
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.interp(np.log(values), *np.log(table))
    found: Floats = np.exp(logs)
    return found


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
