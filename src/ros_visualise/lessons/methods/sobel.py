"""Derivatives of an image by Sobel's kernels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels

Whole = npt.NDArray[np.int64]


def binomial(order: int) -> Whole:
    """The row of Pascal's triangle with ``order + 1`` numbers."""
    row = np.ones(1, np.int64)
    for _ in range(order):
        row = np.convolve(row, (1, 1))
    return row


def sobel_kernels(aperture: int) -> tuple[Whole, Whole]:
    """Smoothing and differentiating kernel, (aperture,) each.

    Args:
        aperture: 3, 5 or 7.
    """
    return binomial(aperture - 1), np.convolve(binomial(aperture - 3), (-1, 0, 1))


def sobel(gray: Pixels, aperture: int) -> tuple[Whole, Whole]:
    """The derivatives to the right and down, unscaled; the border is replicated.

    Args:
        gray: 8 or 16 bits.
        aperture: of the kernels, 3, 5 or 7.
    """
    smooth, derive = sobel_kernels(aperture)
    return correlate(gray, derive, smooth), correlate(gray, smooth, derive)


def correlate(gray: Pixels, along: Whole, down: Whole) -> Whole:
    """Weighted sums over windows: one row of weights to the right, another one down."""
    reach = len(along) // 2
    height, width = gray.shape
    wide = np.pad(gray.astype(np.int64), reach, mode="edge")
    across = sum((w * wide[:, i : i + width] for i, w in enumerate(along)), np.int64(0))
    sums: Whole = sum((w * across[i : i + height] for i, w in enumerate(down)), np.int64(0))
    return sums


def direction(dx: Whole | Floats, dy: Whole | Floats) -> Floats:
    """Direction of the gradient, in degrees from 0 to 360: 0 right, 90 down."""
    angle: Floats = np.degrees(np.arctan2(dy, dx)) % 360
    return angle


def magnitude(dx: Whole | Floats, dy: Whole | Floats) -> Floats:
    """Length of the gradient."""
    length: Floats = np.hypot(dx, dy)
    return length


def central_difference(values: Pixels) -> Floats:
    """The derivative of (N,) from both neighbours of each; the ends are replicated."""
    wide = np.pad(values.astype(float), 1, mode="edge")
    slope: Floats = (wide[2:] - wide[:-2]) / 2
    return slope
