"""Readings of detections in the fixed frame, as equations of a Kalman filter.

The errors of a landmark are x, y, z in metres and a rotation vector, about the axes of the fixed
frame. The robot's error, common to all sightings at one time, has six numbers too: the translation
of the camera and its rotation about itself, relative to tf.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Hypothesis
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import cross, turn_between

UNKNOWN = 1e5
"""Variance, m^2 or rad^2, above which a direction counts as unknown."""


class Equations(NamedTuple):
    """A measurement of k numbers, to first order.

    Attributes:
        residual: (k,) measured minus expected.
        H: (k, 6) derivative by the landmark's error.
        J: (k, 6) derivative by the robot's error.
        noise: (k, k) covariance of the rest.
    """

    residual: Floats
    H: Floats
    J: Floats
    noise: Floats


Expect = Callable[[Floats, Floats], Equations]
"""(position (3,) and R_fixed_landmark (3, 3) of a landmark) -> the equations of a measurement."""


@dataclass(frozen=True)
class PoseReading:
    """One hypothesis of a detection, in the fixed frame.

    ``position_xyz`` (3,) is the measured position, 1 m away if only the direction is known;
    ``R_fixed_landmark`` is None without an orientation. ``camera_xyz`` (3,) is the position of the
    camera. ``score`` is the hypothesis's.
    """

    position_xyz: Floats
    R_fixed_landmark: Floats | None
    has_range: bool
    camera_xyz: Floats
    score: float
    expect: Expect


def sighting_of(hypothesis: Hypothesis, T_fixed_camera: Floats) -> PoseReading | None:
    """The reading of a hypothesis; None without a pose or a valid covariance."""
    R, camera = T_fixed_camera[:3, :3], T_fixed_camera[:3, 3]
    covariance = hypothesis.covariance
    position = hypothesis.position_xyz
    range_m = float(np.linalg.norm(position))
    quat_norm = float(np.linalg.norm(hypothesis.quat_xyzw))
    if not _is_covariance(covariance) or not (0 < range_m < np.inf and 0.5 < quat_norm < 2):
        return None
    turned = np.kron(np.eye(2), R)
    noise = turned @ covariance @ turned.T
    seen = camera + R @ position
    ray = R @ position / range_m
    has_range = bool(ray @ noise[:3, :3] @ ray < UNKNOWN)
    has_turn = has_range and bool(np.trace(noise[3:, 3:]) < UNKNOWN)
    turn = R @ rotations.to_matrix(hypothesis.quat_xyzw) if has_turn else None
    if turn is not None:
        expect = _pose(seen, turn, noise, camera)
    elif has_range:
        expect = _point(seen, noise[:3, :3], camera)
    else:
        expect = _direction(ray, noise[:3, :3] / range_m**2, camera)
    return PoseReading(seen, turn, has_range, camera, hypothesis.score, expect)


@dataclass(frozen=True)
class Ground:
    """The plane on which objects stand, in the fixed frame.

    Its points satisfy ``normal_xyz @ position == height_m`` up to a standard deviation ``sigma_m``.
    It constrains each object's own place, so it counts once for each object.
    """

    normal_xyz: Floats
    height_m: float
    sigma_m: float

    def meet(self, sighting: PoseReading) -> Floats | None:
        """(3,) intersection of the plane with the ray of a reading; None if there is no
        intersection.
        """
        camera = sighting.camera_xyz
        ray = sighting.position_xyz - camera
        sinks, above = -self.normal_xyz @ ray, self.normal_xyz @ camera - self.height_m
        if sinks * above <= 0:
            return None
        met: Floats = camera + ray * (above / sinks)
        return met

    def expect(self, position: Floats, R: Floats) -> Equations:
        """The constraint that a landmark stands on the plane."""
        H = np.concatenate([self.normal_xyz, np.zeros(3)])[None]
        residual = np.array([self.height_m - self.normal_xyz @ position])
        return Equations(residual, H, np.zeros((1, 6)), np.array([[self.sigma_m**2]]))


def robot_error_at(position_xyz: Floats, camera_xyz: Floats) -> Floats:
    """(6, 6) effect of the robot's error on what is seen at a position."""
    effect = -np.eye(6)
    effect[:3, 3:] = cross(position_xyz - camera_xyz)
    return effect


def _pose(seen: Floats, turn: Floats, noise: Floats, camera: Floats) -> Expect:
    def expect(position: Floats, R: Floats) -> Equations:
        residual = np.concatenate([seen - position, turn_between(turn, R)])
        return Equations(residual, np.eye(6), robot_error_at(position, camera), noise)

    return expect


def _point(seen: Floats, noise: Floats, camera: Floats) -> Expect:
    def expect(position: Floats, R: Floats) -> Equations:
        J = robot_error_at(position, camera)[:3]
        return Equations(seen - position, np.eye(3, 6), J, noise)

    return expect


def _direction(ray: Floats, noise: Floats, camera: Floats) -> Expect:
    """The direction alone: two numbers, across the ray."""
    across: Floats = np.linalg.svd(ray[None])[2][1:]
    lateral = across @ noise @ across.T

    def expect(position: Floats, R: Floats) -> Equations:
        away = position - camera
        project = across / max(float(ray @ away), 1e-6)
        J = project @ robot_error_at(position, camera)[:3]
        H = project @ np.eye(3, 6)
        return Equations(-project @ away, H, J, lateral)

    return expect


def _is_covariance(covariance: Floats) -> bool:
    """True if it is finite and positive semidefinite."""
    if not np.isfinite(covariance).all() or (np.diag(covariance) <= 0).any():
        return False
    values = np.linalg.eigvalsh(covariance)
    return bool(values[0] > -1e-9 * values[-1]) and np.allclose(covariance, covariance.T)
