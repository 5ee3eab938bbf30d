"""Laying one trajectory over another before they are compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import transforms

ALIGNMENTS = ("none", "origin", "se3", "sim3")
"""How: as it is; by the first poses; by all positions; by all positions, with a scale."""

_FLAT = 1e-14  # of the largest singular value: below it, positions lie on a line


@dataclass(frozen=True)
class Similarity:
    """Takes a position p to ``scale * rotation @ p + translation_xyz``.

    ``rotation`` is (3, 3), ``translation_xyz`` (3,) in metres.
    """

    rotation: Floats
    translation_xyz: Floats
    scale: float = 1.0

    def apply(self, T: Floats) -> Floats:
        """Poses T (N, 4, 4) in the other frame; they are scaled, their rotations are not."""
        turned = self.rotation @ T[:, :3, :3]
        moved = self.scale * T[:, :3, 3] @ self.rotation.T + self.translation_xyz
        return transforms.from_parts(turned, moved)


def align(T_truth: Floats, T_estimate: Floats, how: str) -> Similarity:
    """What lays an estimate over the truth.

    Args:
        T_truth, T_estimate: (N, 4, 4), poses that belong together.
        how: one of `ALIGNMENTS`.

    Raises:
        ValueError: the positions lie on a line, about which nobody knows the rotation.
    """
    if how == "none":
        return Similarity(np.eye(3), np.zeros(3))
    if how == "origin":
        T = T_truth[0] @ transforms.inverse(T_estimate[0])
        return Similarity(T[:3, :3], T[:3, 3])
    return fit_similarity(T_estimate[:, :3, 3], T_truth[:, :3, 3], with_scale=how == "sim3")


def fit_similarity(points_xyz: Floats, targets_xyz: Floats, with_scale: bool) -> Similarity:
    """The motion, and scale, that takes points (N, 3) nearest to their targets (N, 3).

    Raises:
        ValueError: the points lie on a line, about which nobody knows the rotation.

    Source: S. Umeyama, Least-squares estimation of transformation parameters between two point
    patterns, IEEE PAMI 13 (1991), equations 38 to 43.
    """
    center, target = points_xyz.mean(axis=0), targets_xyz.mean(axis=0)
    spread = points_xyz - center
    covariance = (targets_xyz - target).T @ spread / len(points_xyz)
    U, singular, Vt = np.linalg.svd(covariance)
    if singular[1] <= _FLAT * singular[0]:
        raise ValueError("the positions lie on a line, so the rotation about it is unknown")
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    rotation = (U * signs) @ Vt
    variance = (spread**2).sum() / len(points_xyz)
    scale = float(singular @ signs / variance) if with_scale else 1.0
    return Similarity(rotation, target - scale * rotation @ center, scale)
