"""GPS: fixes that correct the robot, and where the map is on the Earth."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.navigation import twists
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.robot import CORE, DATUM, POSE, SLOW, YAW
from ros_visualise.landmarks.navigation.state import FilterState

_BACK_NS = 2_000_000_000  # a stamp that is so much older than the last: that one was wrong
_LONGEST_S = 0.5  # a fix that is so much older than the next odometry tells nothing
_BASE = 10.0  # deviations of a fix, that the first two have to be apart to tell the heading
_VAGUE_M, _VAGUE_RAD = 100.0, 0.3
_HEIGHT = 2.0  # times as uncertain is a height, where the receiver does not say


@dataclass(frozen=True)
class GpsNoise:
    """What GPS does wrong.

    Attributes:
        sigma_m: standard deviation east and north, of a receiver that does not say it.
        slow: part of the variance that is of errors which change slowly.
        time_s: in which these are forgotten.
        origin: latitude, longitude and altitude where the map has its origin, its x axis to the
            east; None: nobody knows, both are found out.
    """

    sigma_m: float = 2.0
    slow: float = 0.95
    time_s: float = 60.0
    origin: tuple[float, float, float] | None = None


class GpsFix(NamedTuple):
    """One fix: east, north and up of the origin, in metres.

    Attributes:
        before_ns: the time of the fix before.
        covariance: (3, 3) m^2.
        arm: (3,) where the antenna is in the robot's axes.
    """

    stamp_ns: int
    before_ns: int
    enu: Floats
    covariance: Floats
    arm: Floats


class GpsBuffer:
    """The last seconds of a receiver.

    Attributes:
        used, refused: how many fixes were, as they came.
    """

    def __init__(self, model: GpsNoise) -> None:
        self.model = model
        self.used = self.refused = 0
        self._plane = LocalPlane(*model.origin) if model.origin else None
        self._is_placed = model.origin is not None
        self._first: tuple[Floats, Floats] | None = None
        self._fixes: list[GpsFix] = []

    def add(self, stamp_ns: int, geodetic: Floats, covariance: Floats, arm: Floats) -> bool:
        """Take a fix (3,) that is newer than all others; a covariance of zeros is not known."""
        if self._fixes and stamp_ns < self._fixes[-1].stamp_ns - _BACK_NS:
            self._fixes = []  # one stamp was of another time
        before_ns = self._fixes[-1].stamp_ns if self._fixes else stamp_ns
        if stamp_ns < before_ns or not np.isfinite(geodetic).all():
            return False
        if self._plane is None:
            self._plane = LocalPlane(*geodetic.tolist())
        if not (np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance)[0] > 0):
            covariance = np.diag([1, 1, _HEIGHT**2]) * self.model.sigma_m**2
        enu = self._plane.to_enu(geodetic)
        self._fixes.append(GpsFix(stamp_ns, before_ns, enu, covariance, arm))
        return True

    def place(self, state: FilterState, now: Propagation) -> bool:
        """Find out where GPS counts from, as soon as the robot has gone far enough; whether now."""
        if self._is_placed or not self._fixes:
            return False
        fix = self._fixes[-1]
        at = now.robot.p + now.robot.R @ fix.arm
        if self._first is None:
            self._first = fix.enu, at
            return False
        (dx, dy), (east, north) = (at - self._first[1])[:2], (fix.enu - self._first[0])[:2]
        far = _BASE * np.sqrt(np.trace(fix.covariance[:2, :2]) / 2)
        if min(np.hypot(dx, dy), np.hypot(east, north)) < far:
            return False
        yaw = np.arctan2(dy, dx) - np.arctan2(north, east)
        R = rotations.to_matrix(rotations.from_rpy([0.0, 0.0, yaw]))
        state.robot = replace(state.robot, datum_R=R, datum_p=at - R @ fix.enu)
        change = twists.about_origin(at)[np.ix_(YAW, YAW)]
        vague = np.diag([_VAGUE_M**2] * 3 + [_VAGUE_RAD**2])
        state.covariance[DATUM, DATUM] = change @ vague @ change.T
        self._is_placed = True
        return True

    def between(self, from_ns: int, to_ns: int) -> list[GpsFix]:
        """Those after a time, until another."""
        if not self._is_placed:
            return []
        stamps = [fix.stamp_ns for fix in self._fixes]
        return self._fixes[bisect_right(stamps, from_ns) : bisect_right(stamps, to_ns)]

    def forget(self, before_ns: int) -> None:
        """Let go of what is older, but for the last fix of it."""
        stamps = [fix.stamp_ns for fix in self._fixes]
        del self._fixes[: max(bisect_right(stamps, before_ns) - 1, 0)]


def correct(carried: Propagation, fix: GpsFix, stamp_ns: int, model: GpsNoise) -> bool:
    """Let a fix correct a robot of soon after; whether it fits."""
    late_s = (stamp_ns - fix.stamp_ns) / 1e9
    if late_s > _LONGEST_S:
        return False
    _age(carried, (fix.stamp_ns - fix.before_ns) / 1e9, model)
    robot = carried.robot
    at = robot.p + robot.R @ fix.arm - robot.v * late_s
    back = robot.datum_R.T
    slow = np.linalg.cholesky(model.slow * fix.covariance + 1e-12 * np.eye(3))
    H = np.zeros((3, CORE))
    H[:, POSE] = np.hstack([back, -back @ twists.cross(at)])
    H[:, DATUM] = -H[:, YAW]
    H[:, SLOW] = slow
    residual = fix.enu - back @ (at - robot.datum_p) - slow @ robot.slow
    return carried.correct(residual, H, (1 - model.slow) * fix.covariance, 0.0)


def _age(carried: Propagation, seconds: float, model: GpsNoise) -> None:
    """The slow error goes on: a first-order Gauss-Markov process.

    Source: A. Gelb, Applied Optimal Estimation, 1974, section 2.4.
    """
    keep = float(np.exp(-seconds / model.time_s))
    J, noise = np.eye(CORE), np.zeros((CORE, CORE))
    J[SLOW, SLOW] *= keep
    noise[SLOW, SLOW] = (1 - keep**2) * np.eye(3)
    carried.go(J, noise)
    carried.robot = replace(carried.robot, slow=keep * carried.robot.slow)
