"""IMU: propagates the robot by angular velocities and accelerations."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
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
_MOVED = VELOCITY.stop  # the first errors: pose, scales and velocity
_GAP_NS = 100_000_000  # longest gap between measurements
_BACK_NS = 1_000_000_000  # stamps going back more than this mean that time was reset


@dataclass(frozen=True)
class ImuNoise:
    """Standard deviations of IMU errors, as in data sheets.

    Attributes:
        gyro, accel: noise densities, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).
        gyro_bias, accel_bias: initial biases, rad/s and m/s^2.
        gyro_walk, accel_walk: bias random walks, rad/s/sqrt(s) and m/s^2/sqrt(s).
    """

    gyro: float = 1e-3
    accel: float = 0.01
    gyro_bias: float = 0.01
    accel_bias: float = 0.1
    gyro_walk: float = 1e-4
    accel_walk: float = 1e-3


@dataclass(frozen=True, eq=False)
class ImuMounting:
    """Pose of an IMU on the robot: T_base_imu, (3, 3) and (3,)."""

    R: Floats
    p: Floats


class ImuInterval(NamedTuple):
    """An interval of nearly constant rates (3,) in rad/s and specific force (3,) in m/s^2."""

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
    def has_data(self) -> bool:
        """True if it has measurements."""
        return bool(self._stamps_ns)

    def add(self, stamp_ns: int, rates: Floats, force: Floats, mounting: ImuMounting) -> None:
        """Add a measurement, in the IMU's axes, newer than all others.

        Off the robot's origin an IMU also measures the robot's rotation about it.
        """
        if self._stamps_ns and stamp_ns < self._stamps_ns[-1] - _BACK_NS:
            self.forget_all()  # time was reset
        is_number = np.isfinite(rates).all() and np.isfinite(force).all()
        if not is_number or (self._stamps_ns and stamp_ns <= self._stamps_ns[-1]):
            return
        w, f = mounting.R @ rates, mounting.R @ force
        spin = se3.cross(w)
        f = f - spin @ spin @ mounting.p
        if self._stamps_ns:
            seconds = (stamp_ns - self._stamps_ns[-1]) / 1e9
            f = f - se3.cross((w - self._rates[-1]) / seconds) @ mounting.p
        self._stamps_ns.append(stamp_ns)
        self._rates.append(w)
        self._forces.append(f)

    def between(self, from_ns: int, to_ns: int) -> ImuIntervals | None:
        """The intervals between two times, in the robot's axes; None if any is missing."""
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
        """Forget all measurements."""
        self._stamps_ns, self._rates, self._forces = [], [], []

    def forget(self, before_ns: int) -> None:
        """Forget older measurements, except the last of them."""
        count = max(bisect_right(self._stamps_ns, before_ns) - 1, 0)
        del self._stamps_ns[:count], self._rates[:count], self._forces[:count]


def propagate_by_imu(propagation: Propagation, parts: ImuIntervals, model: ImuNoise) -> None:
    """Propagate by all measurements of an interval, with one Jacobian for the whole of it.

    Source: A. Barrau, S. Bonnabel, as in `ros_visualise.landmarks.navigation.robot`: the
    propagation of errors of pose and velocity does not depend on the estimate; J. Sola, Quaternion
    kinematics for the error-state Kalman filter, 2017, section 5, for the biases; C. Forster et
    al., On-manifold preintegration for real-time visual-inertial odometry, 2017, for joining the
    intervals.
    """
    robot = propagation.robot
    seconds = np.array([part.seconds for part in parts])[:, None]
    middles, R = _attitudes(robot, parts)
    forces = np.array([part.force for part in parts]) - robot.accel
    pushes = ((middles @ forces[..., None])[..., 0] + robot.gravity) * seconds
    v = robot.v + pushes.cumsum(axis=0)
    p = robot.p + ((v - pushes / 2) * seconds).cumsum(axis=0)
    left = seconds.sum() - seconds.cumsum(axis=0)
    fall = se3.cross(robot.gravity)
    turned = _turned(p, v, left[..., None], fall)
    J = _motion(float(seconds.sum()), fall)
    lasting = middles * seconds[..., None]
    J[:_MOVED, GYRO] = -(turned @ lasting).sum(axis=0)
    J[:3, ACCEL] = -(lasting * (left + seconds / 2)[..., None]).sum(axis=0)
    J[VELOCITY, ACCEL] = -lasting.sum(axis=0)
    propagation.propagate(J, _noise(turned, seconds, left, model))
    propagation.robot = replace(robot, R=R, p=p[-1], v=v[-1])


def _attitudes(robot: RobotState, parts: ImuIntervals) -> tuple[Floats, Floats]:
    """Attitudes in the middle of each interval (K, 3, 3), and at the end (3, 3)."""
    R, middles = robot.R, []
    for part in parts:
        half = cv2.Rodrigues((part.rates - robot.gyro) * (part.seconds / 2))[0]
        middles.append(R @ half)
        R = middles[-1] @ half
    return np.array(middles), R


def _turned(p: Floats, v: Floats, left: Floats, fall: Floats) -> Floats:
    """(K, _MOVED, 3) effect on the final errors of a rotation (3,) at the end of each interval.

    Args:
        p, v: (K, 3) at the end of each interval.
        left: (K, 1, 1) seconds until the end of all.
        fall: (3, 3) cross-product matrix of gravity.
    """
    swing = se3.cross(v)
    turned = np.zeros((len(p), _MOVED, 3))
    turned[:, :3] = se3.cross(p) + swing * left + fall * (left**2 / 2)
    turned[:, 3:6] = _EYE
    turned[:, VELOCITY] = swing + fall * left
    return turned


def _motion(seconds: float, fall: Floats) -> Floats:
    """(CORE, CORE) propagation of the errors over so many seconds, except the biases."""
    J = np.eye(CORE)
    J[:3, VELOCITY] = seconds * _EYE
    J[VELOCITY, 3:6] = fall * seconds
    J[:3, 3:6] = fall * (seconds**2 / 2)
    J[VELOCITY.start, GRAVITY.start] = J[VELOCITY.start + 1, GRAVITY.start + 1] = seconds
    J[0, GRAVITY.start] = J[1, GRAVITY.start + 1] = seconds**2 / 2
    return J


def _noise(turned: Floats, seconds: Floats, left: Floats, model: ImuNoise) -> Floats:
    """(CORE, CORE) covariance that all intervals add to the errors."""
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
