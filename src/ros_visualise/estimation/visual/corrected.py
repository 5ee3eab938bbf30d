"""Poses that move with the keyframes around them, when closures have corrected these.

A pose between two keyframes is moved by the correction interpolated between theirs. Its covariance
is interpolated likewise, which is exact where errors add up step by step; to it are added the
pose's own error relative to its keyframe, and the scale error that all lengths share. No loop
reveals the latter: a loop that is 1% too large closes as well.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.visual.closing import ClosedWay
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.estimation.visual.views import SeenPlace
from ros_visualise.geometry import similarity
from ros_visualise.geometry.similarity import Similarity


def without_scale(poses: Sequence[VisualPose], scale_sigma: float) -> list[VisualPose]:
    """The same poses, their covariances without that of the scale that all lengths share.

    Args:
        scale_sigma: its standard deviation, as a fraction.
    """
    return [
        one._replace(covariance=_positive(one.covariance - _of_scale(one.p, scale_sigma)))
        for one in poses
    ]


def corrected_poses(
    poses: Sequence[VisualPose],
    places: Sequence[SeenPlace],
    way: ClosedWay,
    scale_sigma: float = 0.0,
) -> list[VisualPose]:
    """Poses moved as the keyframes around them, with their covariances; see the module.

    Args:
        poses: in the order of their stamps, with covariances `without_scale`.
        places: the keyframes, which are among the poses.
        way: their corrected poses.
        scale_sigma: see `without_scale`.
    """
    by_stamp = {one.stamp_ns: one for one in poses}
    keys = [by_stamp[place.stamp_ns] for place in places]
    changes = [
        similarity.product(after, similarity.inverse(Similarity(1.0, one.R, one.p)))
        for one, after in zip(keys, way.poses, strict=True)
    ]
    stamps_ns = [one.stamp_ns for one in keys]
    found = []
    for one in poses:
        if one.stamp_ns <= stamps_ns[0]:  # no closure changes it
            P = one.covariance + _of_scale(one.p, scale_sigma)
            found.append(one._replace(covariance=P))
            continue
        k = bisect_right(stamps_ns, one.stamp_ns) - 1
        change, covariance = changes[k], way.covariances[k]
        is_between = k + 1 < len(keys) and places[k].stretch == places[k + 1].stretch
        if is_between:
            part = (one.stamp_ns - stamps_ns[k]) / (stamps_ns[k + 1] - stamps_ns[k])
            step = similarity.product(changes[k + 1], similarity.inverse(change))
            change = similarity.product(similarity.exp(part * similarity.log(step)), change)
            covariance = (1 - part) * covariance + part * way.covariances[k + 1]
        placed = similarity.product(change, Similarity(1.0, one.R, one.p))
        turned = similarity.adjoint(change)[:6, :6]
        own = turned @ _positive(one.covariance - keys[k].covariance) @ turned.T
        P = _of_pose(covariance, placed.t) + own + _of_scale(placed.t, scale_sigma)
        found.append(one._replace(R=placed.R, p=placed.t, covariance=P))
    return found


def _of_pose(covariance: Floats, p: Floats) -> Floats:
    """(6, 6) of a pose at p, by that (7, 7) of a similarity: a larger map has it farther away."""
    change = np.eye(6, 7)
    change[:3, 6] = p
    of_pose: Floats = change @ covariance @ change.T
    return of_pose


def _of_scale(p: Floats, sigma: float) -> Floats:
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = sigma**2 * np.outer(p, p)
    return covariance


def _positive(covariance: Floats) -> Floats:
    """The nearest covariance to a difference of two."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    positive: Floats = (vectors * values.clip(min=0)) @ vectors.T
    return positive
