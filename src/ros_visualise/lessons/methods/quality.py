"""Picture quality and information."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Pixels

FULL = 255


def mean_square(one: Pixels, other: Pixels) -> float:
    """Mean of the squared differences, over pixels and channels."""
    return float(np.mean((one.astype(np.float64) - other) ** 2))


def psnr(one: Pixels, other: Pixels) -> float:
    """Peak signal to noise ratio in decibels: 10 log10(255² / mean square); infinite if equal."""
    error = mean_square(one, other)
    return 10 * math.log10(FULL**2 / error) if error else math.inf


def quantize(pixels: Pixels, bits: int) -> Pixels:
    """2^bits levels instead of 256, spread from 0 to 255."""
    shift = 8 - bits
    top = (1 << bits) - 1
    levels: Pixels = np.rint((pixels >> shift) * (FULL / top)).astype(np.uint8)
    return levels


def entropy(pixels: Pixels) -> float:
    """Mean information of a pixel in bits: −Σ p log2 p."""
    counts = np.bincount(pixels.ravel(), minlength=256)
    share = counts[counts > 0] / counts.sum()
    return float(-(share * np.log2(share)).sum()) + 0.0
