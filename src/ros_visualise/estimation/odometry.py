"""Odometry: propagates the robot, or is compared with an IMU that does.

Its poses are a chain of motions. Each has random errors; its scales are wrong by a slowly changing
fraction. Without these two states, ten metres with one error would look like a thousand independent
ones.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.gates import GATES
from ros_visualise.estimation.robot import BEFORE, POSE, VELOCITY, core, own_states
from ros_visualise.estimation.state import State
from ros_visualise.geometry import se3
from ros_visualise.geometry.rigid import Pose, compose, interpolate, inverse, to_matrix

SCALES = own_states("scales of odometry", 2)
"""Scale errors of distances and rotations, as fractions."""
AXES = own_states("axes of odometry", 3)
"""Rotation from the axes of the odometry's motions to the robot's, rad: a robot on wheels may be
tilted, and still move along the ground.
"""

GAP_NS = 250_000_000
"""Longest interval between two odometry poses; a longer one is a gap."""

_UNREPORTED = np.zeros(4)
_EYE = np.eye(3)
_LEAST = 1e-10  # variance, m^2 and rad^2, of exact odometry
_SPEED_SIGMA = 1.0  # m/s, velocity uncertainty of one odometry step
VAGUE_SPEED = 10.0
"""Standard deviation of an unknown velocity, m/s."""
_LEEWAY = np.repeat([2e-3, 1e-3], 3)  # m and rad: jitter and rounding of odometry
_SHORTEST_S = 0.02  # of the intervals by which speeds are judged
_HARDEST_MS2 = 20.0  # of braking: odometry that stops faster has stalled
_STILL = 0.02  # part of its former speed, below which odometry stands still
_STALL_S = 0.1, 2.0  # from when on a stall counts, and until when


class OdometryStep(NamedTuple):
    """A motion measured by odometry.

    Attributes:
        motion: in the robot's axes at the beginning.
        from_ns, to_ns: beginning and end.
        up: (3,) the odometry's vertical, in the robot's axes at the end.
        reported: (4,) variances of the motion along its axes, m^2, and of its heading, rad^2, by
            the odometry itself; 0 if it reports none.
        is_guess: True if it is interpolated across a gap.
        stalled: variance of the motion along each axis, m^2, while the odometry has stalled.
        speed_before: speed before it stalled, m/s; 0: it has not.
    """

    motion: Pose
    from_ns: int
    to_ns: int
    up: Floats
    reported: Floats = _UNREPORTED
    is_guess: bool = False
    stalled: float = 0.0
    speed_before: float = 0.0

    @property
    def seconds(self) -> float:
        """Duration, seconds."""
        return (self.to_ns - self.from_ns) / 1e9

    @property
    def is_long(self) -> bool:
        """True if the odometry may have restarted meanwhile."""
        return self.is_guess or self.to_ns - self.from_ns > GAP_NS

    @property
    def speed(self) -> float:
        """Mean speed, m/s."""
        return math.hypot(*self.motion[:3]) / max(self.seconds, _SHORTEST_S)


def up_of(pose: Pose) -> Floats:
    """(3,) vertical in the axes of a robot at a pose."""
    up: Floats = to_matrix(pose)[2, :3]
    return up


class OdometryPose(NamedTuple):
    """A pose of the robot in the odometry's frame.

    ``variances`` (4,) are of the velocity before it, (m/s)^2, and of the yaw rate, (rad/s)^2, as
    the odometry reports them; 0 if it reports none.
    """

    pose: Pose
    variances: Floats = _UNREPORTED


class Stall(NamedTuple):
    """Odometry that stopped at once, as no robot can brake: it may go on at its former speed.

    Attributes:
        speed: former speed, m/s; 0: it has not stalled.
        since_ns: time of the last pose before.
    """

    speed: float = 0.0
    since_ns: int = 0

    def variance(self, stamp_ns: int) -> float:
        """Variance of the position at a time, m^2: all of the way may be missing."""
        seconds = (stamp_ns - self.since_ns) / 1e9
        least, most = _STALL_S
        return (self.speed * min(seconds, most)) ** 2 if seconds >= least else 0.0


class OdometryBuffer:
    """Poses of the robot in the odometry's frame, by time, in any order of arrival."""

    def __init__(self) -> None:
        self.stamps_ns: list[int] = []
        self._poses: list[OdometryPose] = []
        self._stalls: list[Stall] = []

    @property
    def newest_ns(self) -> int | None:
        """Time of the last pose."""
        return self.stamps_ns[-1] if self.stamps_ns else None

    def add(self, stamp_ns: int, pose: OdometryPose) -> bool:
        """Add a pose; False if there is one of that time."""
        place = bisect_left(self.stamps_ns, stamp_ns)
        if place < len(self.stamps_ns) and self.stamps_ns[place] == stamp_ns:
            return False
        is_newest = place == len(self.stamps_ns)
        self._stalls.insert(place, self._stall(stamp_ns, pose) if is_newest else Stall())
        self.stamps_ns.insert(place, stamp_ns)
        self._poses.insert(place, pose)
        return True

    def _stall(self, stamp_ns: int, pose: OdometryPose) -> Stall:
        """Judge the newest pose by those before it."""
        if len(self._poses) < 2:
            return Stall()
        (a_ns, b_ns), (a, b) = self.stamps_ns[-2:], self._poses[-2:]
        seconds, way_m = (stamp_ns - b_ns) / 1e9, math.dist(b.pose[:3], pose.pose[:3])
        stall = self._stalls[-1]
        if not stall.speed:
            speed = math.dist(a.pose[:3], b.pose[:3]) / max((b_ns - a_ns) / 1e9, _SHORTEST_S)
            stall = Stall(speed if speed > _HARDEST_MS2 * seconds else 0.0, b_ns)
        return stall if way_m < _STILL * stall.speed * seconds else Stall()

    def at(self, stamp_ns: int) -> Pose:
        """The pose at a time between the first and the last, interpolated."""
        after = bisect_left(self.stamps_ns, stamp_ns)
        if self.stamps_ns[after] == stamp_ns:
            return self._poses[after].pose
        start, end = self.stamps_ns[after - 1], self.stamps_ns[after]
        a, b = self._poses[after - 1], self._poses[after]
        return interpolate(a.pose, b.pose, (stamp_ns - start) / (end - start))

    def covers(self, stamp_ns: int) -> bool:
        """True if there are poses before and after a time, or at it."""
        return bool(self.stamps_ns) and self.stamps_ns[0] <= stamp_ns <= self.stamps_ns[-1]

    def steps(self, from_ns: int, to_ns: int) -> list[OdometryStep]:
        """The motions from one time to another."""
        inner = slice(bisect_right(self.stamps_ns, from_ns), bisect_left(self.stamps_ns, to_ns))
        return [self.step(*pair) for pair in pairwise([from_ns, *self.stamps_ns[inner], to_ns])]

    def step(self, from_ns: int, to_ns: int) -> OdometryStep:
        """The motion from one time to another, no pose between them."""
        after = max(bisect_left(self.stamps_ns, to_ns), 1)
        start, end = self.stamps_ns[after - 1], self.stamps_ns[after]
        a, b = self.at(from_ns), self.at(to_ns)
        part = (to_ns - from_ns) / (end - start)
        # errors of intervals are independent: their variances grow with time
        reported = self._poses[after].variances * ((end - start) / 1e9) ** 2 * part
        is_guess = part < 1 and end - start > GAP_NS
        stall = self._stalls[after]
        stalled = (stall.variance(end) - stall.variance(start)) * part
        motion = compose(inverse(a), b)
        doubts = reported, is_guess, stalled, stall.speed
        return OdometryStep(motion, from_ns, to_ns, up_of(b), *doubts)

    def before(self, stamp_ns: int) -> int | None:
        """Time of the last pose before a time."""
        place = bisect_left(self.stamps_ns, stamp_ns)
        return self.stamps_ns[place - 1] if place else None

    def forget(self, before_ns: int) -> None:
        """Forget older poses, except the last of them."""
        count = max(bisect_right(self.stamps_ns, before_ns) - 1, 0)
        del self.stamps_ns[:count], self._poses[:count], self._stalls[:count]


@dataclass(frozen=True)
class OdometryNoise:
    """Standard deviations of odometry errors.

    Attributes:
        scale: initial scale error of all distances, as a fraction.
        turn_scale: initial scale error of all rotations, as a fraction.
        axes: rotation of the motions' axes, rad.
        scale_walk: change of both, per sqrt(m).
        walk: of the position, m/sqrt(m).
        heading_walk: of the heading, rad/sqrt(m).
        tilt_walk: of roll and pitch, rad/sqrt(m).
        turn_walk: of the heading, rad/sqrt(rad), and as many metres of the position: wheels slip
            in turns.
        still_m, still_rad: of position and heading, per sqrt(s), also at standstill.
    """

    scale: float = 0.01
    turn_scale: float = 0.02
    scale_walk: float = 0.001
    walk: float = 0.02
    heading_walk: float = 0.003
    tilt_walk: float = 0.0
    still_m: float = 1e-3
    still_rad: float = 1e-4
    axes: float = 0.0
    turn_walk: float = 0.0

    def of(self, step: OdometryStep, up: Floats) -> tuple[Floats, Floats]:
        """Variances (3,) of a step's position, along the robot's axes, and covariance (3, 3) of its
        rotation, whose vertical is ``up``.
        """
        metres = math.hypot(*step.motion[:3])
        tilt = self.tilt_walk**2 * metres + _LEAST
        heading = self.heading_walk**2 * metres + self.still_rad**2 * step.seconds
        slip = self.turn_walk**2 * 2 * math.acos(min(abs(step.motion[6]), 1.0))
        heading += slip
        heading = max(heading, step.reported[3])
        turned = tilt * _EYE + (heading - tilt) * np.multiply.outer(up, up)
        moved = self.walk**2 * metres + self.still_m**2 * step.seconds + slip
        return np.maximum(moved, step.reported[:3]) + _LEAST, turned

    @property
    def scales(self) -> Floats:
        """(2, 2) covariance of the scales in the beginning."""
        return np.diag([self.scale**2, self.turn_scale**2])

    def scales_walk(self, metres: float) -> Floats:
        """(2, 2) covariance of the change of scales over a distance."""
        known = np.array([self.scale, self.turn_scale]) > 0
        return np.diag(known * self.scale_walk**2 * metres)


def propagate_by_odometry(state: State, step: OdometryStep, model: OdometryNoise) -> None:
    """Propagate by a step of odometry."""
    robot = state.robot
    T = to_matrix(step.motion)
    along = T[:3, 3] + np.cross(robot[AXES], T[:3, 3])
    way, axis = robot.R @ along, robot.R @ _rotation_vector(step.motion)
    ways, turns = 1 + robot[SCALES]
    R = cv2.Rodrigues(turns * axis)[0] @ robot.R
    p = robot.p + ways * way
    seconds = step.seconds
    v, rates = robot.v, robot.rates
    if seconds > 0:
        v, rates = ways * way / seconds, turns * axis / seconds
    arm = se3.cross(p)
    size, scale = core(), SCALES.rows.start
    J = np.eye(size)
    J[:3, scale] = way
    J[:3, scale + 1], J[3:6, scale + 1] = arm @ axis, axis
    J[:3, AXES.rows] = -ways * robot.R @ se3.cross(T[:3, 3])
    J[VELOCITY] = 0
    J[VELOCITY, scale] = v / ways
    moved, turned = model.of(step, R @ step.up)
    moved += step.stalled
    spread = arm @ turned
    noise = np.zeros((size, size))
    noise[:3, :3] = spread @ arm.T + (robot.R * moved) @ robot.R.T
    noise[:3, 3:6], noise[3:6, :3], noise[3:6, 3:6] = spread, spread.T, turned
    noise[VELOCITY, VELOCITY] = _SPEED_SIGMA**2 * _EYE
    noise[SCALES.rows, SCALES.rows] = model.scales_walk(math.hypot(*step.motion[:3]))
    state.propagate(replace(robot, R=R, p=p, v=v, rates=rates), J, noise)


def clone_pose(state: State) -> None:
    """Make the present pose the previous one (stochastic cloning)."""
    state.forget(BEFORE)
    state.share(BEFORE, np.eye(6))
    state.robot = state.robot.standing()


def check_odometry(state: State, step: OdometryStep, model: OdometryNoise) -> State | None:
    """The state corrected by a step of odometry since the previous pose; None if they disagree.

    Source: S. Roumeliotis, J. Burdick, Stochastic cloning: a generalized framework for processing
    relative state measurements, 2002.
    """
    robot = state.robot
    back = robot.before_R.T
    T = to_matrix(step.motion)
    turn = _rotation_vector(step.motion)
    ways, turns = 1 + robot[SCALES]
    between = back @ robot.R
    way = back @ (robot.p - robot.before_p)
    turned_by = se3.turn_between(cv2.Rodrigues(turns * turn)[0], between)
    along = T[:3, 3] + np.cross(robot[AXES], T[:3, 3])
    residual = np.concatenate([ways * along - way, turned_by])
    if np.linalg.norm(way) > step.speed_before * step.seconds / 2 > 0:
        return None  # it goes on, however short the step is
    size, scale = core(), SCALES.rows.start
    H = np.zeros((6, size))
    H[:3, :3], H[:3, 3:6] = back, -back @ se3.cross(robot.p)
    H[3:, 3:6] = back
    H[:, BEFORE] = -H[:, POSE]
    # as expected, not as measured: noise in both would look like a scale error
    H[:3, scale], H[3:, scale + 1] = -way / ways, -se3.rotation_vector(between) / turns
    H[:3, AXES.rows] = se3.cross(way)
    moved, turned = model.of(step, T[:3, :3] @ step.up)
    noise = np.zeros((6, 6))
    noise[:3, :3], noise[3:, 3:] = np.diag(moved), turned
    columns = np.arange(size)
    spread = H @ state.P[:size, :size] @ H.T + noise + np.diag(_LEEWAY**2)
    if residual @ np.linalg.solve(spread, residual) > GATES[6]:
        return None
    return state.corrected(columns, H, residual, noise)


def is_speed_known(state: State) -> bool:
    """True if the velocity is known well enough to propagate by an IMU."""
    return bool(state.P[VELOCITY.start, VELOCITY.start] < VAGUE_SPEED**2 / 2)


def place_robot(
    state: State, R: Floats, p: Floats, covariance: Floats, noise: OdometryNoise
) -> None:
    """Put the robot at a pose, with an independent covariance (6, 6) of its twist.

    Biases, and what is known of GPS and gravity, stay.
    """
    state.forget(POSE, VELOCITY, BEFORE, SCALES.rows, AXES.rows)
    state.inflate(POSE, covariance + _LEAST * np.eye(6))
    state.inflate(SCALES.rows, noise.scales)
    state.inflate(AXES.rows, noise.axes**2 * _EYE)
    state.inflate(VELOCITY, VAGUE_SPEED**2 * _EYE)
    robot = state.robot.with_own(SCALES, np.zeros(2)).with_own(AXES, np.zeros(3))
    state.robot = replace(robot, R=R, p=p, v=np.zeros(3), before_R=R, before_p=p)


def _rotation_vector(motion: Pose) -> Floats:
    x, y, z, w = motion[3:]
    sine = math.sqrt(x * x + y * y + z * z)
    factor = 2 * math.atan2(sine, w) / sine if sine > 1e-12 else 2.0
    if w < 0:
        factor = 2 * math.atan2(-sine, -w) / sine
    return np.array([factor * x, factor * y, factor * z])
