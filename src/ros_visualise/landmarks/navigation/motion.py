"""Propagation of the robot's pose by odometry, with its growing uncertainty."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.geometry.rigid import Pose, compose, inverse, to_matrix
from ros_visualise.geometry.se3 import turn_between
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.robot import BEFORE, CORE, POSE, SCALES, VELOCITY
from ros_visualise.landmarks.navigation.state import FilterState

_EYE = np.eye(3)
GAP_NS = 250_000_000
"""Longest interval between two odometry poses; a longer one is a gap."""

_LEAST = 1e-10  # variance, m^2 and rad^2, of exact odometry
_SPEED_SIGMA = 1.0  # m/s, velocity uncertainty of one odometry step
_VAGUE_SPEED = 10.0  # m/s, unknown velocity
_LEEWAY = np.repeat([2e-3, 1e-3], 3)  # m and rad: jitter and rounding of odometry


class OdometryStep(NamedTuple):
    """A motion measured by odometry.

    Attributes:
        motion: in the robot's axes at the beginning.
        from_ns, to_ns: beginning and end.
        up: (3,) the odometry's vertical, in the robot's axes at the end.
        is_guess: True if it is interpolated across a gap.
    """

    motion: Pose
    from_ns: int
    to_ns: int
    up: Floats
    is_guess: bool = False

    @property
    def seconds(self) -> float:
        """Duration, seconds."""
        return (self.to_ns - self.from_ns) / 1e9

    @property
    def is_long(self) -> bool:
        """True if the odometry may have restarted meanwhile."""
        return self.is_guess or self.to_ns - self.from_ns > GAP_NS


def step_between(
    a: Pose, b: Pose, from_ns: int, to_ns: int, is_guess: bool = False
) -> OdometryStep:
    """The step from one pose in the odometry's frame to another."""
    return OdometryStep(compose(inverse(a), b), from_ns, to_ns, up_of(b), is_guess)


def up_of(pose: Pose) -> Floats:
    """(3,) vertical in the axes of a robot at a pose."""
    up: Floats = to_matrix(pose)[2, :3]
    return up


@dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations of odometry errors.

    Attributes:
        scale: constant scale error of all distances, as a fraction.
        turn_scale: constant scale error of all rotations, as a fraction.
        walk: of the position, m/sqrt(m).
        heading_walk: of the heading, rad/sqrt(m).
        tilt_walk: of roll and pitch, rad/sqrt(m).
        still_m, still_rad: of position and heading, per sqrt(s), also at standstill.
    """

    scale: float = 0.01
    turn_scale: float = 0.0
    walk: float = 0.02
    heading_walk: float = 0.003
    tilt_walk: float = 0.0
    still_m: float = 1e-3
    still_rad: float = 1e-4

    def of(self, step: OdometryStep, up: Floats) -> tuple[float, Floats]:
        """Variance of a step's position, and covariance (3, 3) of its rotation."""
        metres = math.sqrt(sum(x * x for x in step.motion[:3]))
        tilt = self.tilt_walk**2 * metres + _LEAST
        heading = self.heading_walk**2 * metres + self.still_rad**2 * step.seconds
        turned = tilt * _EYE + (heading - tilt) * np.multiply.outer(up, up)
        return self.walk**2 * metres + self.still_m**2 * step.seconds + _LEAST, turned


def propagate_by_odometry(
    propagation: Propagation, step: OdometryStep, model: OdometryNoise
) -> None:
    """Propagate by a step of odometry."""
    robot = propagation.robot
    T = to_matrix(step.motion)
    way, axis = robot.R @ T[:3, 3], robot.R @ _rotation_vector(step.motion)
    ways, turns = 1 + robot.scales
    R = cv2.Rodrigues(turns * axis)[0] @ robot.R
    p = robot.p + ways * way
    v = ways * way / step.seconds if step.seconds > 0 else robot.v
    arm = se3.cross(p)
    J = np.eye(CORE)
    J[:3, 6] = way
    J[:3, 7], J[3:6, 7] = arm @ axis, axis
    J[VELOCITY] = 0
    J[VELOCITY, 6] = v / ways
    moved, turned = model.of(step, R @ step.up)
    spread = arm @ turned
    noise = np.zeros((CORE, CORE))
    noise[:3, :3] = spread @ arm.T + moved * _EYE
    noise[:3, 3:6], noise[3:6, :3], noise[3:6, 3:6] = spread, spread.T, turned
    noise[VELOCITY, VELOCITY] = _SPEED_SIGMA**2 * _EYE
    propagation.propagate(J, noise)
    propagation.robot = replace(robot, R=R, p=p, v=v)


def check_odometry(propagation: Propagation, step: OdometryStep, model: OdometryNoise) -> bool:
    """Compare a propagation since the previous pose with a step of odometry; True if they agree.

    Source: S. Roumeliotis, J. Burdick, Stochastic cloning: a generalized framework for processing
    relative state measurements, 2002.
    """
    robot = propagation.robot
    back = robot.before_R.T
    T = to_matrix(step.motion)
    turn = _rotation_vector(step.motion)
    ways, turns = 1 + robot.scales
    between = back @ robot.R
    told = cv2.Rodrigues(turns * turn)[0]
    way = back @ (robot.p - robot.before_p)
    residual = np.concatenate([ways * T[:3, 3] - way, turn_between(told, between)])
    H = np.zeros((6, CORE))
    H[:3, :3], H[:3, 3:6] = back, -back @ se3.cross(robot.p)
    H[3:, 3:6] = back
    H[:, BEFORE] = -H[:, POSE]
    # as expected, not as measured: noise in both would look like a scale error
    H[:3, 6], H[3:, 7] = -way / ways, -cv2.Rodrigues(between)[0][:, 0] / turns
    moved, turned = model.of(step, T[:3, :3] @ step.up)
    noise = np.zeros((6, 6))
    noise[:3, :3], noise[3:, 3:] = moved * _EYE, turned
    return propagation.correct(residual, H, noise, _LEEWAY)


def is_speed_known(propagation: Propagation) -> bool:
    """True if the velocity is known well enough to propagate by an IMU."""
    return bool(propagation.P[VELOCITY.start, VELOCITY.start] < _VAGUE_SPEED**2 / 2)


def predict(state: FilterState, steps: Iterable[OdometryStep], model: OdometryNoise) -> FilterState:
    """A state propagated by odometry alone."""
    propagation = Propagation(state)
    for step in steps:
        propagate_by_odometry(propagation, step, model)
    return propagation.applied_to(state, frozen=True)


def begin(
    state: FilterState, R: Floats, p: Floats, covariance: Floats, model: OdometryNoise
) -> None:
    """Put the robot at a pose, with an independent covariance (6, 6) of its twist.

    Only biases and what is known of GPS and gravity stay.
    """
    P = state.covariance
    for rows in (POSE, SCALES, VELOCITY, BEFORE):
        P[rows], P[:, rows] = 0, 0
    P[POSE, POSE] = covariance + _LEAST * np.eye(6)
    P[SCALES, SCALES] = np.diag([model.scale**2, model.turn_scale**2])
    P[VELOCITY, VELOCITY] = _VAGUE_SPEED**2 * _EYE
    state.robot = replace(
        state.robot, R=R, p=p, scales=np.zeros(2), v=np.zeros(3), before_R=R, before_p=p
    )


def _rotation_vector(motion: Pose) -> Floats:
    x, y, z, w = motion[3:]
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    if w < 0:
        factor = 2 * math.atan2(-sine, -w) / sine
    return np.array([factor * x, factor * y, factor * z])
