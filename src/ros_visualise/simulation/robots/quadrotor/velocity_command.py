"""A velocity that somebody commands, until it is too old."""

from __future__ import annotations

import math

from ros_visualise.data import Twist
from ros_visualise.simulation.attitude import Vector

MAX_SPEED, MAX_CLIMB = 5.0, 2.5  # m/s


class VelocityCommand:
    """The velocity that a robot in the air is to take up, in level axes that turn with its heading.

    Attributes:
        turn: rad/s, to the left.
    """

    def __init__(self) -> None:
        self._given_s = -math.inf
        self.set((0.0, 0.0, 0.0))

    @property
    def sinks(self) -> bool:
        """It goes down."""
        return self._forward_left_up[2] < 0

    def set(self, forward_left_up: Vector, turn: float = 0.0) -> None:
        """Take a velocity in m/s, and a turn."""
        self._forward_left_up, self.turn = forward_left_up, turn

    def give(self, twist: Twist, time_s: float) -> None:
        """Take what was commanded at a time."""
        x, y, z = twist.linear_xyz.tolist()
        self.set((x, y, z), float(twist.angular_xyz[2]))
        self._given_s = time_s

    def expire(self, time_s: float, timeout_s: float) -> None:
        """Stand still if nothing was given for so long."""
        if time_s - self._given_s > timeout_s:
            self.set((0.0, 0.0, 0.0))

    def velocity(self, yaw: float) -> Vector:
        """In the axes in which the heading is ``yaw``, within limits."""
        forward, left, up = self._forward_left_up
        share = min(1.0, MAX_SPEED / max(math.hypot(forward, left), 1e-9))
        c, s = share * math.cos(yaw), share * math.sin(yaw)
        climb = max(-MAX_CLIMB, min(MAX_CLIMB, up))
        return c * forward - s * left, s * forward + c * left, climb
