"""How the robot's pose goes on by its odometry, and how much less sure it gets."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry.rigid import Pose, compose, inverse, to_matrix
from ros_visualise.landmarks.navigation import twists
from ros_visualise.landmarks.navigation.state import CORE, POSE, SCALES, State

_EYE = np.eye(3)
_LEAST = 1e-10  # variance, m^2 and rad^2, of what is said to be exact


class Step(NamedTuple):
    """A motion that the odometry tells.

    Attributes:
        motion: in the robot's own axes of before.
        seconds: that it took.
        up: (3,) where up is for the odometry, in the robot's axes of after.
    """

    motion: Pose
    seconds: float
    up: Floats


def step_between(a: Pose, b: Pose, seconds: float) -> Step:
    """The step from one pose in the odometry's frame to another."""
    return Step(compose(inverse(a), b), seconds, up_of(b))


def up_of(pose: Pose) -> Floats:
    """(3,) where up is in the axes of a robot at a pose."""
    up: Floats = to_matrix(pose)[2, :3]
    return up


@dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations of what an odometry does wrong.

    Attributes:
        scale: of all ways, as a fraction; lasting.
        turn_scale: of all turns, as a fraction; lasting.
        walk: of the position, m by the root of metres.
        heading_walk: of the heading, rad by the root of metres.
        tilt_walk: of roll and pitch, rad by the root of metres.
        still_m, still_rad: of position and heading, by the root of seconds, also while it stands.
    """

    scale: float = 0.01
    turn_scale: float = 0.0
    walk: float = 0.02
    heading_walk: float = 0.003
    tilt_walk: float = 0.0
    still_m: float = 1e-3
    still_rad: float = 1e-4


class Carried:
    """The robot some time after a state, with how it depends on that.

    Attributes:
        R, p: its pose in the map.
        change: (CORE, CORE) how its errors follow from those of the state.
        noise: (CORE, CORE) covariance of what came to them on the way.
    """

    def __init__(self, state: State) -> None:
        self.R, self.p, self._scales = state.R, state.p, state.scales
        self.change, self.noise = np.eye(CORE), np.zeros((CORE, CORE))

    def go(self, step: Step, model: OdometryNoise) -> None:
        """Go on by a motion."""
        T = to_matrix(step.motion)
        way, axis = self.R @ T[:3, 3], self.R @ _rotation_vector(step.motion)
        ways, turns = 1 + self._scales
        self.p = self.p + ways * way
        self.R = cv2.Rodrigues(turns * axis)[0] @ self.R
        arm = twists.cross(self.p)
        J = np.eye(CORE)
        J[:3, 6] = way
        J[:3, 7], J[3:6, 7] = arm @ axis, axis
        metres = math.sqrt(float(way @ way))
        up, tilt = self.R @ step.up, model.tilt_walk**2 * metres
        heading = model.heading_walk**2 * metres + model.still_rad**2 * step.seconds
        turned = tilt * _EYE + (heading - tilt) * np.multiply.outer(up, up)
        spread = arm @ turned
        self.change = J @ self.change
        noise = J @ self.noise @ J.T
        noise[:3, :3] += spread @ arm.T
        noise[:3, :3] += (model.walk**2 * metres + model.still_m**2 * step.seconds) * _EYE
        noise[:3, 3:6] += spread
        noise[3:6, :3] += spread.T
        noise[3:6, 3:6] += turned
        self.noise = noise

    def covariance(self, state: State) -> Floats:
        """(CORE, CORE) of the robot's errors now, by those of the state."""
        before = state.covariance[:CORE, :CORE]
        now: Floats = self.change @ before @ self.change.T + self.noise
        return now


def predict(state: State, steps: Iterable[Step], model: OdometryNoise) -> None:
    """Carry a state on by motions."""
    robot = Carried(state)
    for step in steps:
        robot.go(step, model)
    P = state.covariance
    now = robot.covariance(state)
    P[:CORE, CORE:] = robot.change @ P[:CORE, CORE:]
    P[CORE:, :CORE] = P[:CORE, CORE:].T
    P[:CORE, :CORE] = (now + now.T) / 2
    state.R, state.p = robot.R, robot.p


def begin(state: State, R: Floats, p: Floats, covariance: Floats, model: OdometryNoise) -> None:
    """Put the robot at a pose, with a covariance (6, 6) of its twist that nothing else shares."""
    P = state.covariance
    P[:CORE], P[:, :CORE] = 0, 0
    P[POSE, POSE] = covariance + _LEAST * np.eye(6)
    P[SCALES, SCALES] = np.diag([model.scale**2, model.turn_scale**2])
    state.R, state.p, state.scales = R, p, np.zeros(2)


def _rotation_vector(motion: Pose) -> Floats:
    x, y, z, w = motion[3:]
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    if w < 0:
        factor = 2 * math.atan2(-sine, -w) / sine
    return np.array([factor * x, factor * y, factor * z])
