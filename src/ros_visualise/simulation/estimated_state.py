"""The state of a robot as its navigator has it: what it steers by under ``control=estimate``.

The navigator's poses correct the robot's own odometry (REP 105: map -> odom), so the state goes on
between them. Roll, pitch and angular velocity are the body's own, as of an autopilot with an IMU.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ros_visualise.data import Floats, Odometry, PoseWithCovarianceStamped
from ros_visualise.geometry import rotations
from ros_visualise.simulation.attitude import Vector, from_yaw, multiply, wrap, yaw_of
from ros_visualise.simulation.robot import BodyState
from ros_visualise.simulation.sensors import setting

_KEPT_NS = 3_000_000_000  # of the odometry, for late poses
_SETTLING_S = 0.3  # a correction is taken over in this time, so that nothing jumps


class ControlPose(Enum):
    """Pose that a robot steers by."""

    TRUTH = "truth"
    ESTIMATE = "estimate"


@dataclass(frozen=True)
class ControlParams:
    """Parameters of the pose that a robot steers by."""

    control: ControlPose = setting(
        ControlPose.TRUTH,
        "pose that missions steer by: the true one, or the estimate of a navigator",
    )
    estimate_timeout: float = setting(
        1.0, "age of the estimate beyond which the robot stops, seconds", min=0.1, max=60
    )
    estimate_patience: float = setting(
        20.0, "time without an estimate after which a mission is aborted, seconds", min=1, max=3600
    )


class EstimatedState:
    """State by the navigator and odometry.

    Args:
        start: position of the body in ``map`` at the start, which is known.
        yaw: its heading there.

    Attributes:
        last_ns: stamp of the last estimate, by the simulation's clock; None before the first.
    """

    def __init__(self, start: Vector, yaw: float) -> None:
        self.last_ns: int | None = None
        self._origin, self._turn = np.array(start), yaw  # of odom in map
        self._goal, self._goal_turn = self._origin, yaw
        self._past: deque[Odometry] = deque()

    def odometry(self, odometry: Odometry) -> None:
        """Process the robot's odometry, in the order of time."""
        if self._past:
            elapsed_s = (odometry.header.stamp_ns - self._past[-1].header.stamp_ns) / 1e9
            part = 1 - math.exp(-elapsed_s / _SETTLING_S)
            self._origin = self._origin + part * (self._goal - self._origin)
            self._turn += part * wrap(self._goal_turn - self._turn)
        self._past.append(odometry)
        while odometry.header.stamp_ns - self._past[0].header.stamp_ns > _KEPT_NS:
            self._past.popleft()

    def estimate(self, pose: PoseWithCovarianceStamped, time_ns: int) -> None:
        """Process the navigator's pose in ``map``; one that is older than the odometry is ignored.

        Args:
            time_ns: the present time.
        """
        stamp_ns = pose.header.stamp_ns
        if not self._past or stamp_ns < self._past[0].header.stamp_ns:
            return
        own = min(self._past, key=lambda one: abs(one.header.stamp_ns - stamp_ns))
        yaws = [_yaw(one.quat_xyzw.tolist()) for one in (pose, own)]
        turn = wrap(yaws[0] - yaws[1])
        origin = pose.position_xyz - _turned(own.position_xyz.tolist(), turn)
        if self.last_ns is None:
            self._origin, self._turn = origin, turn
        self._goal, self._goal_turn = origin, turn
        self.last_ns = min(stamp_ns, time_ns)

    def age_s(self, time_ns: int) -> float:
        """Age of the estimate, infinite before the first."""
        return math.inf if self.last_ns is None else (time_ns - self.last_ns) / 1e9

    def state(self, true: BodyState, time_ns: int) -> BodyState:
        """The state at a time; of the true one, roll, pitch and angular velocity are used."""
        if not self._past:
            x, y, z = self._origin.tolist()
            return true._replace(position=(x, y, z), velocity=(0.0, 0.0, 0.0))
        own = self._past[-1]
        since_s = (time_ns - own.header.stamp_ns) / 1e9
        moving = rotations.to_matrix(own.quat_xyzw) @ own.linear_xyz
        velocity = _turned(moving.tolist(), self._turn)
        place = _turned(own.position_xyz.tolist(), self._turn) + self._origin + since_s * velocity
        yaw = _yaw(own.quat_xyzw.tolist()) + self._turn + since_s * float(own.angular_xyz[2])
        attitude = multiply(from_yaw(yaw - yaw_of(true.attitude)), true.attitude)
        (x, y, z), (vx, vy, vz) = place.tolist(), velocity.tolist()
        return BodyState((x, y, z), attitude, (vx, vy, vz), true.rates)


def _yaw(quat_xyzw: list[float]) -> float:
    x, y, z, w = quat_xyzw
    return yaw_of((w, x, y, z))


def _turned(vector: list[float], turn: float) -> Floats:
    c, s = math.cos(turn), math.sin(turn)
    x, y, z = vector
    return np.array((c * x - s * y, s * x + c * y, z))
