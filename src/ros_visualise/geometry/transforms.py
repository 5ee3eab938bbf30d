"""Transforms as 4x4 matrices: ``T_target_source`` takes points of source to target.

``T_a_c = T_a_b @ T_b_c``. All functions take arrays with any leading axes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations


def from_pose(translation_xyz: npt.ArrayLike, quat_xyzw: npt.ArrayLike) -> Floats:
    """T (..., 4, 4) of translations (..., 3) in metres and quaternions (..., 4).

    Raises:
        ValueError: a quaternion is zero.
    """
    return from_parts(rotations.to_matrix(quat_xyzw), translation_xyz)


def from_parts(rotation: npt.ArrayLike, translation_xyz: npt.ArrayLike) -> Floats:
    """T (..., 4, 4) of rotation matrices (..., 3, 3) and translations (..., 3) in metres."""
    turned, moved = np.asarray(rotation, np.float64), np.asarray(translation_xyz, np.float64)
    T = np.zeros((*np.broadcast_shapes(turned.shape[:-2], moved.shape[:-1]), 4, 4))
    T[..., :3, :3], T[..., :3, 3], T[..., 3, 3] = turned, moved, 1
    return T


def to_pose(T: Floats) -> tuple[Floats, Floats]:
    """Translations (..., 3) in metres and unit quaternions (..., 4)."""
    return T[..., :3, 3].copy(), rotations.from_matrix(T[..., :3, :3])


def inverse(T: Floats) -> Floats:
    """T_source_target (..., 4, 4) of T_target_source."""
    turned_back = np.swapaxes(T[..., :3, :3], -1, -2)
    return from_parts(turned_back, -(turned_back @ T[..., :3, 3:])[..., 0])


def apply(T: Floats, points_xyz: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Points (..., N, 3) taken by T (..., 4, 4) to its target, in their own precision."""
    exact = points_xyz.dtype if points_xyz.dtype.kind == "f" else np.dtype(np.float64)
    turned, moved = T[..., :3, :3].astype(exact), T[..., None, :3, 3].astype(exact)
    found: npt.NDArray[np.floating] = points_xyz @ np.swapaxes(turned, -1, -2) + moved
    return found


def interpolate(T_a: Floats, T_b: Floats, fraction: npt.ArrayLike) -> Floats:
    """T (..., 4, 4) on the way from a, at fraction 0, to b, at 1.

    Translations go straight and rotations the shortest way, independently, as in tf2.
    """
    (from_xyz, a), (to_xyz, b) = to_pose(T_a), to_pose(T_b)
    part = np.asarray(fraction, np.float64)
    moved = from_xyz + part[..., None] * (to_xyz - from_xyz)
    return from_pose(moved, rotations.slerp(a, b, part))
