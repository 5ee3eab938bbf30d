"""Relative poses and their derivatives."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.mapping.normal import Numbers
from ros_visualise.landmarks.mapping.problem import Poses


def relative(poses: Poses) -> Poses:
    """Each of N poses relative to the previous one: N - 1 poses."""
    back = np.swapaxes(poses.R[:-1], 1, 2)
    return Poses(back @ poses.R[1:], np.einsum("nij,nj->ni", back, np.diff(poses.t, axis=0)))


def in_view(views: Poses, bodies: Poses, of_view: Numbers, of_body: Numbers) -> Poses:
    """Bodies in the frames of views."""
    back = np.swapaxes(views.R[of_view], 1, 2)
    apart = bodies.t[of_body] - views.t[of_view]
    return Poses(back @ bodies.R[of_body], (back @ apart[..., None])[..., 0])


def between(
    by_pose: Floats, views: Poses, bodies: Poses, of_view: Numbers, of_body: Numbers
) -> tuple[Floats, Floats]:
    """Derivatives (S, K, 6) by relative poses, converted to those by views and by bodies."""
    back = np.swapaxes(views.R[of_view], 1, 2)
    apart = bodies.t[of_body] - views.t[of_view]
    by_place, by_turn = by_pose[..., :3] @ back, by_pose[..., 3:] @ back
    swung = np.cross(by_place, apart[:, None])  # a . (d x w) = (a x d) . w
    by_body = np.concatenate([by_place, by_turn], axis=2)
    return np.concatenate([-by_place, swung - by_turn], axis=2), by_body


def logarithm(R: Floats) -> Floats:
    """(3,) rotation vector of a rotation matrix."""
    return np.asarray(cv2.Rodrigues(R)[0], np.float64)[:, 0]


def logarithms(R: Floats) -> Floats:
    """(N, 3) rotation vectors of rotations (N, 3, 3) by less than 180 degrees."""
    skew = R - np.swapaxes(R, 1, 2)
    sine2 = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)
    cosine2 = np.trace(R, axis1=1, axis2=2) - 1
    sine = np.linalg.norm(sine2, axis=1)
    angle = np.arctan2(sine, cosine2)
    scale = np.where(sine > 1e-9, angle / np.where(sine > 1e-9, sine, 1), 0.5)
    vectors: Floats = sine2 * scale[:, None]
    return vectors


def offsets(believed: Poses, told: Poses) -> Floats:
    """(N, 6) translation and rotation from believed to given poses, in the axes of both."""
    turned = logarithms(believed.R @ np.swapaxes(told.R, 1, 2))
    return np.concatenate([believed.t - told.t, turned], axis=1)
