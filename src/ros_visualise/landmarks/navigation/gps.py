"""GPS: fixes that correct the robot, and the position of the map on the Earth."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.landmarks.navigation.propagation import Propagation
from ros_visualise.landmarks.navigation.robot import CORE, DATUM, POSE, SLOW, YAW
from ros_visualise.landmarks.navigation.state import FilterState

_BACK_NS = 2_000_000_000  # stamps going back more than this mean that time was reset
_LONGEST_S = 0.5  # largest age of a fix at the next odometry message
_BASE = 10.0  # least distance of two fixes that give the heading, standard deviations
_VAGUE_M, _VAGUE_RAD = 100.0, 0.3
_HEIGHT = 2.0  # ratio of vertical to horizontal error, if not reported


@dataclass(frozen=True)
class GpsNoise:
    """GPS errors.

    Attributes:
        sigma_m: standard deviation east and north if the receiver reports none.
        slow: slowly changing fraction of the variance.
        time_s: time constant of the slow part.
        origin: latitude, longitude and altitude of the map's origin, its x axis pointing east;
            None: estimate both from the fixes.
    """

    sigma_m: float = 2.0
    slow: float = 0.95
    time_s: float = 60.0
    origin: tuple[float, float, float] | None = None


class GpsFix(NamedTuple):
    """One fix: metres east, north and up of the origin.

    Attributes:
        before_ns: time of the previous fix.
        covariance: (3, 3) m^2.
        arm: (3,) position of the antenna in the robot's axes.
    """

    stamp_ns: int
    before_ns: int
    enu: Floats
    covariance: Floats
    arm: Floats


class GpsBuffer:
    """The last seconds of a GPS receiver.

    Attributes:
        used, rejected: numbers of fixes.
    """

    def __init__(self, model: GpsNoise) -> None:
        self.model = model
        self.used = self.rejected = 0
        self._plane = LocalPlane(*model.origin) if model.origin else None
        self._is_placed = model.origin is not None
        self._first: tuple[Floats, Floats] | None = None
        self._fixes: list[GpsFix] = []

    def add(self, stamp_ns: int, geodetic: Floats, covariance: Floats, arm: Floats) -> bool:
        """Add a fix (3,) newer than all others; a zero covariance is unknown."""
        if self._fixes and stamp_ns < self._fixes[-1].stamp_ns - _BACK_NS:
            self._fixes = []  # time was reset
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
        """Locate the GPS origin in the map once the robot moved far enough; True if done now."""
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
        change = se3.about_origin(at)[np.ix_(YAW, YAW)]
        vague = np.diag([_VAGUE_M**2] * 3 + [_VAGUE_RAD**2])
        state.covariance[DATUM, DATUM] = change @ vague @ change.T
        self._is_placed = True
        return True

    def between(self, from_ns: int, to_ns: int) -> list[GpsFix]:
        """The fixes after one time, up to another."""
        if not self._is_placed:
            return []
        stamps = [fix.stamp_ns for fix in self._fixes]
        return self._fixes[bisect_right(stamps, from_ns) : bisect_right(stamps, to_ns)]

    def forget(self, before_ns: int) -> None:
        """Forget older fixes, except the last of them."""
        stamps = [fix.stamp_ns for fix in self._fixes]
        del self._fixes[: max(bisect_right(stamps, before_ns) - 1, 0)]


def correct(propagation: Propagation, fix: GpsFix, stamp_ns: int, model: GpsNoise) -> bool:
    """Correct a robot by a slightly older fix; True if it fits."""
    late_s = (stamp_ns - fix.stamp_ns) / 1e9
    if late_s > _LONGEST_S:
        return False
    _age(propagation, (fix.stamp_ns - fix.before_ns) / 1e9, model)
    robot = propagation.robot
    at = robot.p + robot.R @ fix.arm - robot.v * late_s
    back = robot.datum_R.T
    slow = np.linalg.cholesky(model.slow * fix.covariance + 1e-12 * np.eye(3))
    H = np.zeros((3, CORE))
    H[:, POSE] = np.hstack([back, -back @ se3.cross(at)])
    H[:, DATUM] = -H[:, YAW]
    H[:, SLOW] = slow
    residual = fix.enu - back @ (at - robot.datum_p) - slow @ robot.slow
    return propagation.correct(residual, H, (1 - model.slow) * fix.covariance, 0.0)


def _age(propagation: Propagation, seconds: float, model: GpsNoise) -> None:
    """Propagate the slow error: a first-order Gauss-Markov process.

    Source: A. Gelb, Applied Optimal Estimation, 1974, section 2.4.
    """
    keep = float(np.exp(-seconds / model.time_s))
    J, noise = np.eye(CORE), np.zeros((CORE, CORE))
    J[SLOW, SLOW] *= keep
    noise[SLOW, SLOW] = (1 - keep**2) * np.eye(3)
    propagation.propagate(J, noise)
    propagation.robot = replace(propagation.robot, slow=keep * propagation.robot.slow)
