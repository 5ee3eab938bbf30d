"""The reference of the flight controller: a smoothly moving point with a heading."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ros_visualise.data import Twist
from ros_visualise.simulation.attitude import Vector, wrap
from ros_visualise.simulation.robots.quadrotor.flight import SetPoint

MAX_ACCELERATION = 3.0  # m/s^2
MAX_TURN = math.radians(70)  # per second
_STIFFNESS = 2.0  # 1/s: of the spring that pulls it to a target
_DAMPING = 3.0  # 1/s: response to a velocity
_HEADING = 2.0  # 1/s: response to a heading
_COURSE_M_S = 0.4  # below this speed there is no course to head along
MAX_SPEED, MAX_CLIMB = 5.0, 2.5  # m/s


class Reference:
    """Position, velocity, acceleration and heading, within the robot's limits.

    Attributes:
        position: metres in ``map``.
        velocity: m/s.
        yaw: radians.
    """

    def __init__(self, position: Vector, yaw: float) -> None:
        self.begin(position, yaw)

    @property
    def set_point(self) -> SetPoint:
        """The controller's present set point."""
        return SetPoint(self.position, self.velocity, self._acceleration, self.yaw, self._yaw_rate)

    def begin(self, position: Vector, yaw: float) -> None:
        """Stand still at a pose."""
        self.position, self.yaw = position, yaw
        self.velocity = self._acceleration = (0.0, 0.0, 0.0)
        self._yaw_rate = 0.0

    def move(self, position: Vector, velocity: Vector) -> None:
        """Continue from another position."""
        self.position, self.velocity = position, velocity

    def hold_within(self, reach_m: float, place: Vector, velocity: Vector) -> Vector:
        """Limit the distance from a place; beyond it, also take over its velocity.

        Returns:
            Offset from the place before, along the axes of ``map``, metres.
        """
        x, y, z = (p - s for p, s in zip(self.position, place, strict=True))
        away = math.hypot(x, y, z)
        if away > reach_m:
            share = reach_m / away
            self.move((place[0] + share * x, place[1] + share * y, place[2] + share * z), velocity)
        return x, y, z

    def pull_to(
        self,
        target: Vector,
        yaw: float | None,
        velocity: Vector = (0.0, 0.0, 0.0),
        stiffness: float = _STIFFNESS,
    ) -> None:
        """Accelerate to a target like a critically damped spring; without a yaw, head along.

        Args:
            target: metres in ``map``.
            yaw: radians.
            velocity: of the target, m/s.
            stiffness: of the spring, 1/s: a target with acceleration a is a / stiffness^2 ahead.
        """
        k = stiffness
        moves = zip(target, self.position, velocity, self.velocity, strict=True)
        self._accelerate([k * k * (t - p) + 2 * k * (w - v) for t, p, w, v in moves])
        vx, vy, _ = self.velocity
        course = math.atan2(vy, vx) if math.hypot(vx, vy) > _COURSE_M_S else self.yaw
        self._turn(_HEADING * wrap((course if yaw is None else yaw) - self.yaw))

    def take_up(self, velocity: Vector, yaw_rate: float) -> None:
        """Accelerate to a velocity in ``map``, and rotate."""
        self._turn(yaw_rate)
        self._accelerate([_DAMPING * (w - v) for w, v in zip(velocity, self.velocity, strict=True)])

    def advance(self, dt_s: float) -> None:
        """Move by one step."""
        ax, ay, az = self._acceleration
        (x, y, z), (vx, vy, vz) = self.position, self.velocity
        vx, vy, vz = vx + ax * dt_s, vy + ay * dt_s, vz + az * dt_s
        self.position, self.velocity = (x + vx * dt_s, y + vy * dt_s, z + vz * dt_s), (vx, vy, vz)
        self.yaw = wrap(self.yaw + self._yaw_rate * dt_s)

    def _accelerate(self, wanted: Sequence[float]) -> None:
        size = math.hypot(*wanted)
        share = min(1.0, MAX_ACCELERATION / size) if size else 1.0
        ax, ay, az = (share * a for a in wanted)
        self._acceleration = ax, ay, az

    def _turn(self, wanted: float) -> None:
        self._yaw_rate = max(-MAX_TURN, min(MAX_TURN, wanted))


class VelocityCommand:
    """Commanded velocity, until it is too old, in level axes that turn with the heading.

    Attributes:
        turn: rad/s, to the left.
    """

    def __init__(self) -> None:
        self._given_s = -math.inf
        self.set((0.0, 0.0, 0.0))

    @property
    def sinks(self) -> bool:
        """True if it points down."""
        return self._forward_left_up[2] < 0

    def set(self, forward_left_up: Vector, turn: float = 0.0) -> None:
        """Set a velocity in m/s, and an angular velocity."""
        self._forward_left_up, self.turn = forward_left_up, turn

    def give(self, twist: Twist, time_s: float) -> None:
        """Process a command at a time."""
        x, y, z = twist.linear_xyz.tolist()
        self.set((x, y, z), float(twist.angular_xyz[2]))
        self._given_s = time_s

    def expire(self, time_s: float, timeout_s: float) -> None:
        """Stop if there was no command for so long."""
        if time_s - self._given_s > timeout_s:
            self.set((0.0, 0.0, 0.0))

    def velocity(self, yaw: float) -> Vector:
        """In the axes in which the heading is ``yaw``, within limits."""
        forward, left, up = self._forward_left_up
        share = min(1.0, MAX_SPEED / max(math.hypot(forward, left), 1e-9))
        c, s = share * math.cos(yaw), share * math.sin(yaw)
        climb = max(-MAX_CLIMB, min(MAX_CLIMB, up))
        return c * forward - s * left, s * forward + c * left, climb
