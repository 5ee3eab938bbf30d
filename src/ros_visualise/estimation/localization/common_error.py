"""The common error of all landmarks of a map, and the individual error of each.

A map that starts slightly rotated is rotated everywhere: each landmark is uncertain then, but their
relative positions are well known. Treating the common error as independent errors would make the
mean of many landmarks look far too certain. Errors are twists of the map here
(`ros_visualise.geometry.se3`), so a common one is the same for all of them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ros_visualise.data import Floats

_ROUNDS = 2  # of weighing
_LEAST = 1e-14  # smallest individual variance, m^2 and rad^2


def split(joint: Floats) -> tuple[Floats, Floats]:
    """The covariance (6, 6) of the common error, and (M, 6, 6) of the individual ones.

    The common error is the weighted mean of all; landmarks that differ little from it weigh more.
    Correlations between individual errors are neglected.

    Args:
        joint: (M, 6, M, 6) covariance of the twists of M landmarks.
    """
    count = len(joint)

    def times(weights: Floats) -> Floats:
        product: Floats = np.einsum("iajb,jbc->iac", joint, weights)
        return product

    return split_by(joint[np.arange(count), :, np.arange(count)], times)


def split_by(blocks: Floats, times: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """`split` of a covariance that is not written out.

    Args:
        blocks: (M, 6, 6) its blocks.
        times: it times (M, 6, C).
    """
    count = len(blocks)
    if count < 2:
        return np.zeros((6, 6)), blocks
    own = np.tile(np.eye(6), (count, 1, 1))
    for _ in range(_ROUNDS):
        weights = np.linalg.inv(own + _LEAST * np.eye(6))
        mean = np.linalg.solve(weights.sum(axis=0), weights)  # (M, 6, 6), their sum is 1
        across = times(np.swapaxes(mean, 1, 2))
        common = (mean @ across).sum(axis=0)
        apart = blocks - across - np.swapaxes(across, 1, 2) + common
        own = apart * count / (count - 1)
    return (common + common.T) / 2, (own + np.swapaxes(own, 1, 2)) / 2


def beside(whole: Floats, common: Floats) -> Floats:
    """(6, 6) a landmark's covariance minus the common one, positive semidefinite."""
    values, axes = np.linalg.eigh(whole - common)
    left: Floats = axes * np.maximum(values, 0) @ axes.T
    return left
