"""Filters by their definitions, in NumPy alone, for the tests to compare with."""

import numpy as np


def windows(gray, size, mode):
    """The (size x size) neighbourhood of each pixel: (height, width, size, size)."""
    padded = np.pad(gray, size // 2, mode)
    return np.lib.stride_tricks.sliding_window_view(padded, (size, size))


def gaussian(size, sigma):
    """A normalised (size x size) Gaussian window."""
    x = np.arange(size) - size // 2
    line = np.exp(-(x**2) / (2 * sigma**2))
    return np.outer(line, line) / line.sum() ** 2


def differ_by(one, other):
    """The largest difference of two images of the same type and shape."""
    assert one.dtype == other.dtype
    assert one.shape == other.shape
    return np.abs(one.astype(float) - other.astype(float)).max()
