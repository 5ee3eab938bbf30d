"""Rigid motions, SE(3): as 4x4 matrices, as rotation and position, and their small errors.

``T_target_source`` takes points of source to target, and ``T_a_c = T_a_b @ T_b_c``. All functions
take arrays with any leading axes.

Errors of poses are twists: a translation (3,), then a rotation (3,), as a small motion of the map.
A true pose is ``exp(twist)`` applied to the estimated one, for robot and landmarks alike. So a
motion of the whole map is the same twist for all of them, wherever they are. The pose of the map as
a whole is unobservable, and no Jacobian in these errors contains information on it, whatever the
estimates are: the rule that first-estimate Jacobians keep by remembering old estimates.

Source: T. Barfoot, State Estimation for Robotics, 2017, section 7.1; G. Huang, A. Mourikis, S.
Roumeliotis, Observability-based rules for designing consistent EKF SLAM estimators, IJRR 2010 (the
rule); A. Barrau, S. Bonnabel, An EKF-SLAM algorithm with consistency properties, 2015 (the errors
that keep it at every estimate).
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations

_SMALL = 1e-4  # radians, below which the factors of a rotation change by less than 1e-8
_EYE = np.eye(3)


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


def exp(twist: Floats) -> tuple[Floats, Floats]:
    """Rotations (..., 3, 3) and translations (..., 3) of twists (..., 6).

    Source: T. Barfoot, State Estimation for Robotics, 2017, equations 7.33 and 7.37.
    """
    axis = twist[..., 3:]
    angle = np.maximum(np.sqrt((axis * axis).sum(axis=-1)), _SMALL)[..., None, None]
    sine = np.sin(angle) / angle
    first = 2 * (np.sin(angle / 2) / angle) ** 2
    second = (1 - sine) / angle**2
    across = cross(axis)
    twice = across @ across
    shift = (_EYE + first * across + second * twice) @ twist[..., :3, None]
    return _EYE + sine * across + first * twice, shift[..., 0]


def log(R: Floats, p: Floats) -> Floats:
    """(6,) twist of a rotation (3, 3) and a translation (3,): the inverse of `exp`."""
    turn = rotation_vector(R)
    angle = float(np.linalg.norm(turn))
    across = cross(turn)
    second = 1 / 12
    if angle > 1e-4:  # the quotient loses its digits below
        second = (1 - angle / (2 * np.tan(angle / 2))) / angle**2
    back = _EYE - across / 2 + second * across @ across
    return np.concatenate([back @ p, turn])


def logs(R: Floats, p: Floats) -> Floats:
    """(N, 6) twists of rotations (N, 3, 3), by less than half a turn, and translations (N, 3)."""
    turn = rotation_vectors(R)
    angle = np.maximum(np.linalg.norm(turn, axis=1), _SMALL)[:, None, None]
    across = cross(turn)
    second = (1 - angle / (2 * np.tan(angle / 2))) / angle**2
    back = _EYE - across / 2 + second * across @ across
    return np.hstack([(back @ p[..., None])[..., 0], turn])


def rotation_vector(R: Floats) -> Floats:
    """(3,) axis of a rotation (3, 3), as long as its angle in radians."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine, cosine = float(np.linalg.norm(axis)), (float(np.trace(R)) - 1) / 2
    if cosine < -0.9:  # the axis vanishes at half a turn
        vector: Floats = np.asarray(cv2.Rodrigues(R)[0], np.float64)[:, 0]
        return vector
    return axis * (np.arctan2(sine, cosine) / sine) if sine > 0 else axis


def rotation_vectors(R: Floats) -> Floats:
    """(N, 3) of rotations (N, 3, 3) by less than half a turn."""
    skew = R - np.swapaxes(R, 1, 2)
    sine2 = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    sine = np.linalg.norm(sine2, axis=1)
    angle = np.arctan2(sine, np.trace(R, axis1=1, axis2=2) - 1)
    scale = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1), 0.5)
    vectors: Floats = sine2 * scale[:, None]
    return vectors


def turn_between(R_to: Floats, R_from: Floats) -> Floats:
    """(3,) rotation vector from one rotation to the other, in their common axes."""
    return rotation_vector(R_to @ R_from.T)


def moved(twist: Floats, R: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Poses (..., 3, 3) and (..., 3) moved by twists (..., 6): ``exp(twist) @ T``."""
    turned, shift = exp(twist)
    return turned @ R, (turned @ p[..., None])[..., 0] + shift


def cross(points: Floats) -> Floats:
    """(..., 3, 3) cross-product matrices of ``points`` (..., 3)."""
    matrix = np.zeros((*points.shape, 3))
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def about_origin(position: Floats) -> Floats:
    """(6, 6) from errors of a position and rotations about it to the twist."""
    change = np.eye(6)
    change[:3, 3:] = cross(position)
    return change


def about_itself(position: Floats) -> Floats:
    """(6, 6) from a twist to the errors in messages: of the position, and rotations about it."""
    return about_origin(-position)


def adjoint(R: Floats, p: Floats) -> Floats:
    """(6, 6) from a twist in a frame to the twist in the frame's parent."""
    change = np.zeros((6, 6))
    change[:3, :3] = change[3:, 3:] = R
    change[:3, 3:] = cross(p) @ R
    return change
