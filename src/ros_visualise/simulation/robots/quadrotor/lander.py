"""Visual landing: descend over a visible target, climb if it is lost.

It uses only the robot's own knowledge: the observed target and its odometry. Both are in the frame
of the odometry, whose drift they share.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats, Odometry
from ros_visualise.geometry import rotations
from ros_visualise.simulation.attitude import Vector, wrap, yaw_of
from ros_visualise.simulation.robot import BodyState
from ros_visualise.simulation.robots.quadrotor.reference import Reference

_STIFFNESS = 4.0  # 1/s: of the spring from the reference to a moving target
_LEGS_M = 0.16  # from base_link down to its feet
_STALE_S = 0.3  # largest age of an observation while descending
_FORGOTTEN_S = 5.0  # until then its motion is extrapolated
_SURE_M, _SURE_SLOPE = 0.05, 0.1  # largest standard deviation, by height
_CONE_M, _CONE_SLOPE = 0.06, 0.12  # largest horizontal offset while descending, by height
_SLOWEST, _SLOPE, _FASTEST = 0.2, 0.35, 1.2  # m/s down, by height
_CLIMB = 0.8  # m/s
_LAST_M = 0.12  # below this height it descends unconditionally
_LAST_SPEED = 0.4  # m/s
_BOUNCED_M = 0.5


class Guidance(NamedTuple):
    """Motion to the target, in axes relative to the robot's given heading.

    Attributes:
        aside: x and y of the target from the robot, metres.
        velocity: the target's plus that of the descent, m/s.
        yaw: the target's heading, radians.
    """

    aside: tuple[float, float]
    velocity: Vector
    yaw: float


class Lander:
    """Controls the approach to a target.

    Args:
        height_m: height above the target for searching, and to climb to.

    Attributes:
        touches_down: True in the final descent.
    """

    def __init__(self, height_m: float) -> None:
        self._height_m = height_m
        self._target: Odometry | None = None
        self.touches_down = False

    @property
    def has_seen(self) -> bool:
        """True once the target was seen."""
        return self._target is not None

    def see(self, target: Odometry) -> None:
        """Process the observed pose and velocity of the target."""
        self._target = target

    def steer(self, reference: Reference, own: Odometry | None, state: BodyState) -> None:
        """Pull the reference to the target, including the target's motion."""
        guidance = None if own is None else self.guide(own, yaw_of(state.attitude))
        if guidance is None:
            reference.take_up((0.0, 0.0, 0.0), 0.0)
            return
        (x, y), (px, py, _) = guidance.aside, state.position
        place = px + x, py + y, reference.position[2]
        reference.pull_to(place, guidance.yaw, guidance.velocity, _STIFFNESS)

    def guide(self, own: Odometry, yaw: float) -> Guidance | None:
        """The motion to the target; None if that is unknown.

        Args:
            own: the robot's odometry.
            yaw: the robot's heading in the axes of the result, radians.
        """
        target = self._target
        if target is None:
            return None
        age_s = (own.header.stamp_ns - target.header.stamp_ns) / 1e9
        R = rotations.to_matrix(target.quat_xyzw)
        velocity = R @ target.linear_xyz
        x, y, z = (target.position_xyz + age_s * velocity - own.position_xyz).tolist()
        if abs(age_s) > _FORGOTTEN_S:
            self._target, self.touches_down = None, False
            return None
        clear_m, aside_m = -z - _LEGS_M, math.hypot(x, y)
        is_sure = age_s < _STALE_S and _deviation(target) < _SURE_M + _SURE_SLOPE * clear_m
        climb = self._choose_climb(clear_m, aside_m, is_sure)
        vx, vy, _ = velocity.tolist()
        turn = yaw - _yaw(own)
        aside, (vx, vy) = _turned(x, y, turn), _turned(vx, vy, turn)
        return Guidance(aside, (vx, vy, climb), wrap(_yaw(target) + turn))

    def _choose_climb(self, clear_m: float, aside_m: float, is_sure: bool) -> float:
        """Vertical velocity, m/s."""
        cone_m = _CONE_M + _CONE_SLOPE * max(clear_m, 0.0)
        self.touches_down = clear_m < _BOUNCED_M and (
            self.touches_down or (clear_m < _LAST_M and aside_m < cone_m and is_sure)
        )
        if self.touches_down:
            return -_LAST_SPEED
        if not is_sure:
            return _CLIMB if clear_m < self._height_m else 0.0
        if aside_m > cone_m:
            return 0.0
        return -min(_SLOWEST + _SLOPE * clear_m, _FASTEST) * (1 - aside_m / cone_m)


def _yaw(pose: Odometry) -> float:
    x, y, z, w = pose.quat_xyzw.tolist()
    return yaw_of((w, x, y, z))


def _turned(x: float, y: float, turn: float) -> tuple[float, float]:
    c, s = math.cos(turn), math.sin(turn)
    return c * x - s * y, s * x + c * y


def _deviation(target: Odometry) -> float:
    """The largest standard deviation along the ground, metres."""
    level: Floats = target.pose_covariance[:2, :2]
    return math.sqrt(max(float(np.linalg.eigvalsh(level)[-1]), 0.0))
