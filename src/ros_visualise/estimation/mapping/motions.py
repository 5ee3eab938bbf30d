"""Relative poses and their derivatives."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.mapping.problem import Poses
from ros_visualise.geometry.se3 import rotation_vectors


def relative(poses: Poses) -> Poses:
    """Each of N poses relative to the previous one: N - 1 poses."""
    back = np.swapaxes(poses.R[:-1], 1, 2)
    return Poses(back @ poses.R[1:], np.einsum("nij,nj->ni", back, np.diff(poses.t, axis=0)))


def in_view(eyes: Poses, bodies: Poses) -> Poses:
    """Bodies in the frames of cameras, (S,) each."""
    back = np.swapaxes(eyes.R, 1, 2)
    apart = bodies.t - eyes.t
    return Poses(back @ bodies.R, (back @ apart[..., None])[..., 0])


def between(by_pose: Floats, eyes: Poses, pivots: Floats, bodies: Poses) -> tuple[Floats, Floats]:
    """Derivatives (S, K, 6) by poses in cameras, converted to those by views and by bodies.

    Args:
        by_pose: (S, K, 6) by the pose of a body in its camera.
        eyes: the cameras.
        pivots: (S, 3) what a view's rotation is about: the rig that the camera is a part of.
        bodies: in the map.
    """
    back = np.swapaxes(eyes.R, 1, 2)
    apart = bodies.t - pivots
    by_place, by_turn = by_pose[..., :3] @ back, by_pose[..., 3:] @ back
    swung = np.cross(by_place, apart[:, None])  # a . (d x w) = (a x d) . w
    by_body = np.concatenate([by_place, by_turn], axis=2)
    return np.concatenate([-by_place, swung - by_turn], axis=2), by_body


def offsets(believed: Poses, measured: Poses) -> Floats:
    """(N, 6) translation and rotation from believed to given poses, in the axes of both."""
    turned = rotation_vectors(believed.R @ np.swapaxes(measured.R, 1, 2))
    return np.concatenate([believed.t - measured.t, turned], axis=1)
