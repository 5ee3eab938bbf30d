"""Similarities: rotation, translation and scale, and their twists.

A similarity moves a point x to ``s R x + t``. Its twist (7,) has a translation, a rotation and the
logarithm of a scale.

Source: H. Strasdat, J. Montiel, A. Davison, Scale drift-aware large scale monocular SLAM, RSS 2010.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3

_SMALL = 1e-6


class Similarity(NamedTuple):
    """Scale, rotation (3, 3) and translation (3,)."""

    s: float
    R: Floats
    t: Floats

    def apply(self, T: Floats) -> Floats:
        """Poses T (N, 4, 4) in the other frame; they are scaled, their rotations are not."""
        return se3.from_parts(self.R @ T[:, :3, :3], self.s * T[:, :3, 3] @ self.R.T + self.t)


def product(a: Similarity, b: Similarity) -> Similarity:
    """``a`` after ``b``."""
    return Similarity(a.s * b.s, a.R @ b.R, a.s * a.R @ b.t + a.t)


def inverse(a: Similarity) -> Similarity:
    """The similarity that undoes another one."""
    return Similarity(1 / a.s, a.R.T, -(a.R.T @ a.t) / a.s)


def exp(twist: Floats) -> Similarity:
    """The similarity of a twist (7,)."""
    R, _ = se3.exp(twist[:6])
    s = float(np.exp(twist[6]))
    return Similarity(s, R, _along(twist[3:6], twist[6]) @ twist[:3])


def log(a: Similarity) -> Floats:
    """(7,) twist of a similarity: the inverse of `exp`."""
    turn, size = se3.rotation_vector(a.R), float(np.log(a.s))
    shift = np.linalg.solve(_along(turn, size), a.t)
    return np.concatenate([shift, turn, [size]])


def adjoint(a: Similarity) -> Floats:
    """(7, 7) from a twist in a frame to the twist in the frame's parent: ``a exp(x) a^-1``."""
    change = np.zeros((7, 7))
    change[:3, :3], change[3:6, 3:6] = a.s * a.R, a.R
    change[:3, 3:6] = se3.cross(a.t) @ a.R
    change[:3, 6] = -a.t
    change[6, 6] = 1.0
    return change


def _along(turn: Floats, size: float) -> Floats:
    """(3, 3) integral of exp(u (size + turn^)) over u from 0 to 1."""
    angle = float(np.linalg.norm(turn))
    if angle < _SMALL and abs(size) < _SMALL:
        return np.eye(3) + se3.cross(turn) / 2 + size / 2 * np.eye(3)
    across = se3.cross(turn)
    whole = (np.exp(size) - 1) / size if abs(size) > _SMALL else 1 + size / 2
    if angle < _SMALL:
        first = ((size - 1) * np.exp(size) + 1) / size**2 if abs(size) > _SMALL else 0.5
        return whole * np.eye(3) + first * across
    # integrals of exp(size u) sin(angle u) and exp(size u) cos(angle u)
    both = (np.exp(complex(size, angle)) - 1) / complex(size, angle)
    found: Floats = (
        whole * np.eye(3)
        + both.imag / angle * across
        + (whole - both.real) / angle**2 * across @ across
    )
    return found
