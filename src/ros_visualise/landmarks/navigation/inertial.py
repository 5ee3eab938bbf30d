"""An IMU: how the robot goes on by its rates and accelerations, between two odometries."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.navigation import twists
from ros_visualise.landmarks.navigation.carried import Carried
from ros_visualise.landmarks.navigation.robot import (
    ACCEL,
    CORE,
    GRAVITY,
    GYRO,
    VELOCITY,
)

_EYE = np.eye(3)
_GAP_NS = 100_000_000  # longer without a measurement, an IMU tells nothing
_BACK_NS = 1_000_000_000  # a stamp that is so much older than the last: that one was wrong


@dataclass(frozen=True)
class ImuNoise:
    """Standard deviations of what an IMU does wrong, as its data sheet has them.

    Attributes:
        gyro, accel: densities, rad/s and m/s^2 by the root of hertz.
        gyro_bias, accel_bias: what biases are at first, rad/s and m/s^2.
        gyro_walk, accel_walk: how they change, rad/s and m/s^2 by the root of seconds.
    """

    gyro: float = 1e-3
    accel: float = 0.01
    gyro_bias: float = 0.01
    accel_bias: float = 0.1
    gyro_walk: float = 1e-4
    accel_walk: float = 1e-3


@dataclass(frozen=True, eq=False)
class Mounting:
    """Where an IMU is on the robot: T_base_imu, (3, 3) and (3,)."""

    R: Floats
    p: Floats


class Inertial:
    """The last seconds of an IMU, in the robot's axes and at the robot's origin."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._rates: list[Floats] = []
        self._forces: list[Floats] = []

    @property
    def is_there(self) -> bool:
        """Whether it has measured."""
        return bool(self._stamps_ns)

    def add(self, stamp_ns: int, rates: Floats, force: Floats, mounting: Mounting) -> None:
        """Take a measurement, in the IMU's axes, that is newer than all others.

        Away from the robot's origin an IMU also feels how the robot turns about that.
        """
        if self._stamps_ns and stamp_ns < self._stamps_ns[-1] - _BACK_NS:
            self.forget_all()  # one stamp was of another time
        is_number = np.isfinite(rates).all() and np.isfinite(force).all()
        if not is_number or (self._stamps_ns and stamp_ns <= self._stamps_ns[-1]):
            return
        w, f = mounting.R @ rates, mounting.R @ force
        f = f - np.cross(w, np.cross(w, mounting.p))
        if self._stamps_ns:
            seconds = (stamp_ns - self._stamps_ns[-1]) / 1e9
            f = f - np.cross((w - self._rates[-1]) / seconds, mounting.p)
        self._stamps_ns.append(stamp_ns)
        self._rates.append(w)
        self._forces.append(f)

    def between(self, from_ns: int, to_ns: int) -> list[tuple[float, Floats, Floats]] | None:
        """Seconds, rates and forces of each part of a time; None where there is too little."""
        times = self._stamps_ns
        first, end = bisect_right(times, from_ns) - 1, bisect_left(times, to_ns)
        if first < 0:
            return None
        stamps = [from_ns, *times[first + 1 : end], to_ns]
        known = [*times[first:end], times[end] if end < len(times) else to_ns]
        if max(b - a for a, b in pairwise(known)) > _GAP_NS:
            return None
        parts = []
        for n, (a, b) in enumerate(pairwise(stamps), first):
            m = min(n + 1, len(times) - 1)
            mean = (self._rates[n] + self._rates[m]) / 2, (self._forces[n] + self._forces[m]) / 2
            parts.append(((b - a) / 1e9, *mean))
        return parts

    def forget_all(self) -> None:
        """Begin anew."""
        self._stamps_ns, self._rates, self._forces = [], [], []

    def forget(self, before_ns: int) -> None:
        """Let go of what is older, but for the last measurement of it."""
        count = max(bisect_right(self._stamps_ns, before_ns) - 1, 0)
        del self._stamps_ns[:count], self._rates[:count], self._forces[:count]


def by_imu(carried: Carried, seconds: float, rates: Floats, force: Floats, model: ImuNoise) -> None:
    """Go on by rates (3,) in rad/s and specific force (3,) in m/s^2, in the robot's axes.

    Source: A. Barrau, S. Bonnabel, as in `ros_visualise.landmarks.navigation.robot`: how pose and
    velocity depend on what they were does not depend on what they are; J. Sola, Quaternion
    kinematics for the error-state Kalman filter, 2017, section 5, for the biases.
    """
    robot = carried.robot
    turn = (rates - robot.gyro) * seconds
    half = robot.R @ cv2.Rodrigues(turn / 2)[0]
    R = robot.R @ cv2.Rodrigues(turn)[0]
    a = half @ (force - robot.accel) + robot.gravity
    p = robot.p + (robot.v + a * (seconds / 2)) * seconds
    v = robot.v + a * seconds
    J = np.eye(CORE)
    fall, arm, swing = twists.cross(robot.gravity), twists.cross(p), twists.cross(v)
    J[:3, VELOCITY] = seconds * _EYE
    J[VELOCITY, 3:6] = fall * seconds
    J[:3, 3:6] = fall * (seconds**2 / 2)
    J[VELOCITY.start, GRAVITY.start] = J[VELOCITY.start + 1, GRAVITY.start + 1] = seconds
    J[0, GRAVITY.start] = J[1, GRAVITY.start + 1] = seconds**2 / 2
    turned = half * seconds
    J[:3, GYRO], J[3:6, GYRO], J[VELOCITY, GYRO] = -arm @ turned, -turned, -swing @ turned
    J[:3, ACCEL], J[VELOCITY, ACCEL] = -turned * (seconds / 2), -turned
    noise = np.zeros((CORE, CORE))
    into = np.zeros((CORE, 3))
    into[:3], into[3:6], into[VELOCITY] = arm, _EYE, swing
    noise += model.gyro**2 * seconds * (into @ into.T)
    noise[VELOCITY, VELOCITY] += model.accel**2 * seconds * _EYE
    noise[GYRO, GYRO] = model.gyro_walk**2 * seconds * _EYE
    noise[ACCEL, ACCEL] = model.accel_walk**2 * seconds * _EYE
    carried.go(J, noise)
    carried.robot = replace(robot, R=R, p=p, v=v)
