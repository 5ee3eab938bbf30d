"""By how much the landmarks of a map are off all together, and each one beside that.

A map that is begun a little turned is turned everywhere: each landmark is badly known then, and
where they are to one another is known well. Whoever took their errors for errors of their own would
believe the mean of many landmarks, and be wrong. Errors are twists of the map here
(`ros_visualise.landmarks.navigation.twists`), so that a common one is the same for all of them.
"""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats

_ROUNDS = 2  # of weighing
_LEAST = 1e-14  # square metres and square radians, that an own error has


def split(joint: Floats) -> tuple[Floats, Floats]:
    """The covariances (6, 6) of the common error, and (M, 6, 6) of what each has beside it.

    The common error is the mean of all, weighed by how little each one differs from it. That what
    two landmarks have beside it may hang together is left out.

    Args:
        joint: (M, 6, M, 6) covariance of the twists of M landmarks.
    """
    count = len(joint)
    if count < 2:
        return np.zeros((6, 6)), joint[np.arange(count), :, np.arange(count)]
    whole = joint.reshape(6 * count, 6 * count)
    own = np.tile(np.eye(6), (count, 1, 1))
    mean = np.zeros((6, 6 * count))
    for _ in range(_ROUNDS):
        weights = np.linalg.inv(own + _LEAST * np.eye(6))
        mean = np.linalg.solve(weights.sum(axis=0), np.hstack([*weights]))
        apart = np.eye(6 * count) - np.tile(mean, (count, 1))
        blocks = (apart @ whole @ apart.T).reshape(count, 6, count, 6)
        own = blocks[np.arange(count), :, np.arange(count)] * count / (count - 1)
    common = mean @ whole @ mean.T
    return (common + common.T) / 2, (own + np.swapaxes(own, 1, 2)) / 2


def beside(whole: Floats, common: Floats) -> Floats:
    """(6, 6) what is left of a landmark's covariance without the common one, nowhere negative."""
    values, axes = np.linalg.eigh(whole - common)
    left: Floats = axes * np.maximum(values, 0) @ axes.T
    return left
