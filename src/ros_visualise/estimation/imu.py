"""IMU: propagates the robot by angular velocities and accelerations."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, Protocol

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.robot import GRAVITY, VELOCITY, RobotState, core, own_states
from ros_visualise.geometry import se3

GYRO = own_states("bias of the gyroscope", 3)
ACCEL = own_states("bias of the accelerometer", 3)

_EYE = np.eye(3)
_MOVED = VELOCITY.stop  # the first errors: pose and velocity
_GAP_NS = 100_000_000  # longest gap between measurements
_SHAKEN_NS = 1_000_000_000
_LEAST_SHAKEN, _MOST_SHAKEN = 20, 200  # measurements that tell how much it shakes
_LONGEST_NS = 8_000_000_000  # that is kept, with no odometry to use it


@dataclass(frozen=True)
class ImuNoise:
    """Standard deviations of IMU errors, as in data sheets.

    Attributes:
        gyro, accel: noise densities, rad/s/sqrt(Hz) and m/s^2/sqrt(Hz).
        gyro_bias, accel_bias: initial biases, rad/s and m/s^2.
        gyro_walk, accel_walk: bias random walks, rad/s/sqrt(s) and m/s^2/sqrt(s).
        clock_s: delay of the rates in the sensor, and what is between its clock and the odometry's.
    """

    gyro: float = 1e-3
    accel: float = 0.01
    gyro_bias: float = 0.01
    accel_bias: float = 0.1
    gyro_walk: float = 1e-4
    accel_walk: float = 1e-3
    clock_s: float = 2e-3


@dataclass(frozen=True, eq=False)
class Mounting:
    """Pose of a sensor on the robot: T_base_sensor, (3, 3) and (3,)."""

    R: Floats
    p: Floats


class ImuInterval(NamedTuple):
    """An interval with its mean rates (3,) in rad/s and specific force (3,) in m/s^2.

    ``change`` (3,) is that of the rates in it, rad/s.
    """

    seconds: float
    rates: Floats
    force: Floats
    change: Floats


ImuIntervals = list[ImuInterval]


class ImuSample(NamedTuple):
    """Angular velocity (3,), rad/s, and specific force (3,), m/s^2, in the robot's axes."""

    rates: Floats
    force: Floats
    mounted_at: Floats


class ImuBuffer:
    """The last seconds of an IMU, in any order of arrival."""

    def __init__(self) -> None:
        self._stamps_ns: list[int] = []
        self._samples: list[ImuSample] = []

    @property
    def newest_ns(self) -> int | None:
        """Time of the last measurement."""
        return self._stamps_ns[-1] if self._stamps_ns else None

    def add(self, stamp_ns: int, rates: Floats, force: Floats, mounting: Mounting) -> bool:
        """Add a measurement, in the IMU's axes; False if it is not a number, or a duplicate."""
        place = bisect_left(self._stamps_ns, stamp_ns)
        is_there = place < len(self._stamps_ns) and self._stamps_ns[place] == stamp_ns
        if is_there or not (np.isfinite(rates).all() and np.isfinite(force).all()):
            return False
        self._stamps_ns.insert(place, stamp_ns)
        self._samples.insert(place, ImuSample(mounting.R @ rates, mounting.R @ force, mounting.p))
        self.forget(self._stamps_ns[-1] - _LONGEST_NS)
        return True

    def before(self, stamp_ns: int) -> int:
        """Time of the last measurement before a time, or that time itself."""
        place = bisect_left(self._stamps_ns, stamp_ns)
        return self._stamps_ns[place - 1] if place else stamp_ns

    def _at_origin(self, n: int) -> Floats:
        """(3,) specific force at the robot's origin: elsewhere an IMU also feels its rotation."""
        w, f, at = self._samples[n]
        if not at.any():
            return f
        spin = se3.cross(w)
        f = f - spin @ spin @ at
        if n:
            seconds = (self._stamps_ns[n] - self._stamps_ns[n - 1]) / 1e9
            f = f - se3.cross((w - self._samples[n - 1].rates) / seconds) @ at
        return f

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
            rates = (self._samples[n].rates + self._samples[m].rates) / 2
            force = (self._at_origin(n) + self._at_origin(m)) / 2
            part = (b - a) / max(known[n - first + 1] - known[n - first], 1)
            change = (self._samples[m].rates - self._samples[n].rates) * part
            parts.append(ImuInterval((b - a) / 1e9, rates, force, change))
        return parts

    def densities(self, until_ns: int) -> tuple[float, float]:
        """Noise densities of rates and forces, by what is random in the last second.

        The second differences of a smooth motion are small, those of white noise six times its
        variance: a robot that shakes is as noisy as its sensor is said to be, and more.
        """
        end = bisect_right(self._stamps_ns, until_ns)
        first = max(bisect_left(self._stamps_ns, until_ns - _SHAKEN_NS), end - _MOST_SHAKEN)
        if end - first < _LEAST_SHAKEN:
            return 0.0, 0.0
        seconds = (self._stamps_ns[end - 1] - self._stamps_ns[first]) / 1e9 / (end - first - 1)
        several = np.array([(one.rates, one.force) for one in self._samples[first:end]])
        squares = np.square(np.diff(several, n=2, axis=0)).mean(axis=(0, 2)) / 6
        rates, force = np.sqrt(squares * seconds).tolist()
        return rates, force

    def forget(self, before_ns: int) -> None:
        """Forget older measurements, except the last two of them."""
        count = max(bisect_right(self._stamps_ns, before_ns) - 2, 0)
        del self._stamps_ns[:count], self._samples[:count]


class Propagated(Protocol):
    """A state with a robot, see `ros_visualise.estimation.state.State.propagate`."""

    robot: RobotState

    def propagate(self, robot: RobotState, J: Floats, noise: Floats, /) -> None:
        """Replace the robot, and change its errors by J (core, core) and noise (core, core)."""


def propagate_by_imu(state: Propagated, parts: ImuIntervals, model: ImuNoise) -> None:
    """Propagate by all measurements of an interval, with one Jacobian for the whole of it.

    Source: A. Barrau, S. Bonnabel, as in `ros_visualise.estimation.robot`: the
    propagation of errors of pose and velocity does not depend on the estimate; J. Sola, Quaternion
    kinematics for the error-state Kalman filter, 2017, section 5, for the biases; C. Forster et
    al., On-manifold preintegration for real-time visual-inertial odometry, 2017, for joining the
    intervals.
    """
    robot = state.robot
    seconds = np.array([part.seconds for part in parts])[:, None]
    middles, R = _attitudes(robot, parts)
    forces = np.array([part.force for part in parts]) - robot[ACCEL]
    pushes = ((middles @ forces[..., None])[..., 0] + robot.gravity) * seconds
    v = robot.v + pushes.cumsum(axis=0)
    p = robot.p + ((v - pushes / 2) * seconds).cumsum(axis=0)
    left = seconds.sum() - seconds.cumsum(axis=0)
    fall = se3.cross(robot.gravity)
    turned = _turned(p, v, left[..., None], fall)
    J = _motion(float(seconds.sum()), fall)
    lasting = middles * seconds[..., None]
    J[:_MOVED, GYRO.rows] = -(turned @ lasting).sum(axis=0)
    J[:3, ACCEL.rows] = -(lasting * (left + seconds / 2)[..., None]).sum(axis=0)
    J[VELOCITY, ACCEL.rows] = -lasting.sum(axis=0)
    rates = R @ (parts[-1].rates - robot[GYRO])
    moved = replace(robot, R=R, p=p[-1], v=v[-1], rates=rates)
    changes = (middles @ np.array([part.change for part in parts])[..., None]) * model.clock_s
    state.propagate(moved, J, _noise(turned, seconds, left, model, (turned @ changes).sum(axis=0)))


def _attitudes(robot: RobotState, parts: ImuIntervals) -> tuple[Floats, Floats]:
    """Attitudes in the middle of each interval (K, 3, 3), and at the end (3, 3)."""
    R, middles = robot.R, []
    for part in parts:
        half = cv2.Rodrigues((part.rates - robot[GYRO]) * (part.seconds / 2))[0]
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
    """(n, n) propagation of the errors over so many seconds, except the biases."""
    J = np.eye(core())
    J[:3, VELOCITY] = seconds * _EYE
    J[VELOCITY, 3:6] = fall * seconds
    J[:3, 3:6] = fall * (seconds**2 / 2)
    J[VELOCITY.start, GRAVITY.start] = J[VELOCITY.start + 1, GRAVITY.start + 1] = seconds
    J[0, GRAVITY.start] = J[1, GRAVITY.start + 1] = seconds**2 / 2
    return J


def _noise(
    turned: Floats, seconds: Floats, left: Floats, model: ImuNoise, delayed: Floats
) -> Floats:
    """(n, n) covariance that all intervals add to the errors.

    ``delayed`` (_MOVED, 1) is the error of one standard deviation of the clock.
    """
    noise = np.zeros((core(), core()))
    rows = np.concatenate(turned * (model.gyro * np.sqrt(seconds[..., None])), axis=1)
    noise[:_MOVED, :_MOVED] = rows @ rows.T + delayed @ delayed.T
    of_v, of_both, of_p = (float((seconds * left**n).sum()) * model.accel**2 for n in range(3))
    noise[VELOCITY, VELOCITY] += of_v * _EYE
    noise[VELOCITY, :3] += of_both * _EYE
    noise[:3, VELOCITY] += of_both * _EYE
    noise[:3, :3] += of_p * _EYE
    noise[GYRO.rows, GYRO.rows] = model.gyro_walk**2 * seconds.sum() * _EYE
    noise[ACCEL.rows, ACCEL.rows] = model.accel_walk**2 * seconds.sum() * _EYE
    return noise
