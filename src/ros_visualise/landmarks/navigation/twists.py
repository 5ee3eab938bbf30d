"""Errors of poses as small motions of the map: a translation (3,), then a rotation (3,).

A true pose is ``exp(twist)`` applied to the estimated one, for robot and landmarks alike. So a
motion of the whole map is the same twist for all of them, wherever they are. The pose of the map as
a whole is unobservable, and no Jacobian here contains information on it, whatever the estimates
are: the rule that first-estimate Jacobians keep by remembering old estimates.

Source: G. Huang, A. Mourikis, S. Roumeliotis, Observability-based rules for designing consistent
EKF SLAM estimators, IJRR 2010 (the rule); A. Barrau, S. Bonnabel, An EKF-SLAM algorithm with
consistency properties, 2015 (the errors that keep it at every estimate).
"""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats

_SMALL = 1e-6  # radians, below which the first terms of sine and cosine are enough
_EYE = np.eye(3)


def moved(twist: Floats, R: Floats, p: Floats) -> tuple[Floats, Floats]:
    """Poses (..., 3, 3) and (..., 3) moved by twists (..., 6): ``exp(twist) @ T``.

    Source: T. Barfoot, State Estimation for Robotics, 2017, equations 7.33 and 7.37.
    """
    axis = twist[..., 3:]
    angle = np.sqrt((axis * axis).sum(axis=-1))[..., None, None]
    is_turn = angle > _SMALL
    safe = np.where(is_turn, angle, 1.0)
    sine = np.where(is_turn, np.sin(angle) / safe, 1.0)
    first = np.where(is_turn, (1 - np.cos(angle)) / safe**2, 0.5)
    second = np.where(is_turn, (1 - sine) / safe**2, 1 / 6)
    across = cross(axis)
    twice = across @ across
    turned = _EYE + sine * across + first * twice
    shift = (_EYE + first * across + second * twice) @ twist[..., :3, None]
    return turned @ R, (turned @ p[..., None] + shift)[..., 0]


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
