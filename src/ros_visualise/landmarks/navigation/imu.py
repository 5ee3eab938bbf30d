"""An IMU: how the robot goes on by its rates and accelerations, between two odometries."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.landmarks.navigation import twists
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.robot import (
    ACCEL,
    CORE,
    GRAVITY,
    GYRO,
    VELOCITY,
    RobotState,
)

_EYE = np.eye(3)
_MOVED = VELOCITY.stop  # the first errors: those of pose, scales and velocity
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
class ImuMounting:
    """Where an IMU is on the robot: T_base_imu, (3, 3) and (3,)."""

    R: Floats
    p: Floats


class ImuInterval(NamedTuple):
    """Some seconds in which rates (3,) in rad/s and force (3,) in m/s^2 hardly changed."""

    seconds: float
    rates: Floats
    force: Floats


ImuIntervals = list[ImuInterval]


class ImuBuffer:
    """The last seconds of an IMU, in the robot's axes and at the robot's origin."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._rates: list[Floats] = []
        self._forces: list[Floats] = []

    @property
    def is_there(self) -> bool:
        """Whether it has measured."""
        return bool(self._stamps_ns)

    def add(self, stamp_ns: int, rates: Floats, force: Floats, mounting: ImuMounting) -> None:
        """Take a measurement, in the IMU's axes, that is newer than all others.

        Away from the robot's origin an IMU also feels how the robot turns about that.
        """
        if self._stamps_ns and stamp_ns < self._stamps_ns[-1] - _BACK_NS:
            self.forget_all()  # one stamp was of another time
        is_number = np.isfinite(rates).all() and np.isfinite(force).all()
        if not is_number or (self._stamps_ns and stamp_ns <= self._stamps_ns[-1]):
            return
        w, f = mounting.R @ rates, mounting.R @ force
        spin = twists.cross(w)
        f = f - spin @ spin @ mounting.p
        if self._stamps_ns:
            seconds = (stamp_ns - self._stamps_ns[-1]) / 1e9
            f = f - twists.cross((w - self._rates[-1]) / seconds) @ mounting.p
        self._stamps_ns.append(stamp_ns)
        self._rates.append(w)
        self._forces.append(f)

    def between(self, from_ns: int, to_ns: int) -> ImuIntervals | None:
        """All parts of a time, in the robot's axes; None where there is too little."""
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
            parts.append(ImuInterval((b - a) / 1e9, *mean))
        return parts

    def forget_all(self) -> None:
        """Begin anew."""
        self._stamps_ns, self._rates, self._forces = [], [], []

    def forget(self, before_ns: int) -> None:
        """Let go of what is older, but for the last measurement of it."""
        count = max(bisect_right(self._stamps_ns, before_ns) - 1, 0)
        del self._stamps_ns[:count], self._rates[:count], self._forces[:count]


def by_imu(carried: Propagation, parts: ImuIntervals, model: ImuNoise) -> None:
    """Go on by all that an IMU measured in a time, with one Jacobian for the whole of it.

    Source: A. Barrau, S. Bonnabel, as in `ros_visualise.landmarks.navigation.robot`: how pose and
    velocity depend on what they were does not depend on what they are; J. Sola, Quaternion
    kinematics for the error-state Kalman filter, 2017, section 5, for the biases; C. Forster et
    al., On-manifold preintegration for real-time visual-inertial odometry, 2017, for joining them.
    """
    robot = carried.robot
    seconds = np.array([part.seconds for part in parts])[:, None]
    middles, R = _attitudes(robot, parts)
    forces = np.array([part.force for part in parts]) - robot.accel
    pushes = ((middles @ forces[..., None])[..., 0] + robot.gravity) * seconds
    v = robot.v + pushes.cumsum(axis=0)
    p = robot.p + ((v - pushes / 2) * seconds).cumsum(axis=0)
    left = seconds.sum() - seconds.cumsum(axis=0)
    fall = twists.cross(robot.gravity)
    turned = _turned(p, v, left[..., None], fall)
    J = _motion(float(seconds.sum()), fall)
    lasting = middles * seconds[..., None]
    J[:_MOVED, GYRO] = -(turned @ lasting).sum(axis=0)
    J[:3, ACCEL] = -(lasting * (left + seconds / 2)[..., None]).sum(axis=0)
    J[VELOCITY, ACCEL] = -lasting.sum(axis=0)
    carried.go(J, _noise(turned, seconds, left, model))
    carried.robot = replace(robot, R=R, p=p[-1], v=v[-1])


def _attitudes(robot: RobotState, parts: ImuIntervals) -> tuple[Floats, Floats]:
    """(K, 3, 3) in the middle of each part, and (3, 3) at the end."""
    R, middles = robot.R, []
    for part in parts:
        half = cv2.Rodrigues((part.rates - robot.gyro) * (part.seconds / 2))[0]
        middles.append(R @ half)
        R = middles[-1] @ half
    return np.array(middles), R


def _turned(p: Floats, v: Floats, left: Floats, fall: Floats) -> Floats:
    """(K, _MOVED, 3) what a turn (3,) at the end of each part is for the errors when all is over.

    Args:
        p, v: (K, 3) at the end of each part.
        left: (K, 1, 1) seconds until all is over.
        fall: (3, 3) of gravity.
    """
    swing = twists.cross(v)
    turned = np.zeros((len(p), _MOVED, 3))
    turned[:, :3] = twists.cross(p) + swing * left + fall * (left**2 / 2)
    turned[:, 3:6] = _EYE
    turned[:, VELOCITY] = swing + fall * left
    return turned


def _motion(seconds: float, fall: Floats) -> Floats:
    """(CORE, CORE) how errors follow from those so many seconds before, but for the biases."""
    J = np.eye(CORE)
    J[:3, VELOCITY] = seconds * _EYE
    J[VELOCITY, 3:6] = fall * seconds
    J[:3, 3:6] = fall * (seconds**2 / 2)
    J[VELOCITY.start, GRAVITY.start] = J[VELOCITY.start + 1, GRAVITY.start + 1] = seconds
    J[0, GRAVITY.start] = J[1, GRAVITY.start + 1] = seconds**2 / 2
    return J


def _noise(turned: Floats, seconds: Floats, left: Floats, model: ImuNoise) -> Floats:
    """(CORE, CORE) covariance that comes to the errors in all parts."""
    noise = np.zeros((CORE, CORE))
    rows = np.concatenate(turned * (model.gyro * np.sqrt(seconds[..., None])), axis=1)
    noise[:_MOVED, :_MOVED] = rows @ rows.T
    of_v, of_both, of_p = (float((seconds * left**n).sum()) * model.accel**2 for n in range(3))
    noise[VELOCITY, VELOCITY] += of_v * _EYE
    noise[VELOCITY, :3] += of_both * _EYE
    noise[:3, VELOCITY] += of_both * _EYE
    noise[:3, :3] += of_p * _EYE
    noise[GYRO, GYRO] = model.gyro_walk**2 * seconds.sum() * _EYE
    noise[ACCEL, ACCEL] = model.accel_walk**2 * seconds.sum() * _EYE
    return noise
