"""Thresholds: tone curves, and the threshold that separates the levels best."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

LEVELS = np.arange(256)

Tones = npt.NDArray[np.uint8]


def tone_curves(level: int) -> dict[str, Tones]:
    """Type of a fixed threshold -> output for each level from 0 to 255, (256,)."""
    is_above = level < LEVELS
    curves = {
        "binary": np.where(is_above, 255, 0),
        "binary inverted": np.where(is_above, 0, 255),
        "truncate": np.where(is_above, level, LEVELS),
        "to zero": np.where(is_above, LEVELS, 0),
        "to zero inverted": np.where(is_above, 0, LEVELS),
    }
    return {name: curve.astype(np.uint8) for name, curve in curves.items()}


def between_classes(counts: npt.NDArray[np.int64]) -> Floats:
    """Otsu's measure for each threshold, (256,): the variance between the two classes.

    Args:
        counts: of each level, (256,).

    Source: Otsu, A threshold selection method from gray-level histograms, 1979, equation 18.
    """
    share = counts / counts.sum()
    below = np.cumsum(share)
    first_moment = np.cumsum(share * LEVELS)
    parted = below * (1 - below)
    is_parted = parted > 1e-12
    numerator = (first_moment[-1] * below - first_moment) ** 2
    measure: Floats = np.divide(numerator, parted, out=np.zeros(256), where=is_parted)
    return measure


def otsu(counts: npt.NDArray[np.int64]) -> int:
    """The threshold with the largest variance between the classes; the lowest of equal ones."""
    return int(between_classes(counts).argmax())
