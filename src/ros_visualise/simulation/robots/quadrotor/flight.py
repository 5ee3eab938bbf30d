"""Cascaded control of a quadrotor: position, velocity, attitude, angular velocity, motors.

Axes of the world are x east, y north, z up, of the body x forward, y left, z up.

Source: Mellinger and Kumar, Minimum snap trajectory generation and control for quadrotors, 2011,
section IV; the attitude's loop: Brescianini, Hehn and D'Andrea, Nonlinear quadrocopter attitude
control, 2013.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from ros_visualise.simulation.attitude import Quat, Vector, conjugate, from_yaw, multiply, rows
from ros_visualise.simulation.model import BASE
from ros_visualise.simulation.robot import BodyState

GRAVITY = 9.81
_MAX_TILT = math.radians(35)


@dataclass(frozen=True)
class Airframe:
    """Model of the quadrotor in the controller; SI units.

    Attributes:
        mass: of the whole robot.
        inertia: about the body's axes.
        arm: distance of each motor from the centre, the same along x and y.
        drag: yaw torque of a motor divided by its thrust, metres.
        max_thrust: of one motor.
    """

    mass: float
    inertia: Vector
    arm: float
    drag: float
    max_thrust: float


class SetPoint(NamedTuple):
    """Desired position and heading, and their motion: m/s, m/s^2 and rad/s."""

    position: Vector
    velocity: Vector
    acceleration: Vector
    yaw: float
    yaw_rate: float


class FlightController:
    """Computes the four motors' thrusts from the state and the set point."""

    POSITION = 1.6  # 1/s
    VELOCITY = 3.2  # 1/s
    VELOCITY_INTEGRAL = 2.0  # 1/s^2
    ATTITUDE = 7.0  # 1/s
    RATES = (18.0, 18.0, 6.0)  # 1/s
    _LIMIT_M_S2 = 3.0  # of the velocity's integral

    def __init__(self, frame: Airframe) -> None:
        self._frame = frame
        self.reset()

    def reset(self) -> None:
        """Reset the integrators."""
        self._integral = [0.0, 0.0, 0.0]

    def control(self, state: BodyState, target: SetPoint, dt_s: float) -> tuple[float, ...]:
        """The thrust of each motor, N."""
        force = self._to_force(self._accelerate(state, target, dt_s))
        body_z = rows(state.attitude)
        up = (body_z[0][2], body_z[1][2], body_z[2][2])
        thrust = max(0.0, force[0] * up[0] + force[1] * up[1] + force[2] * up[2])
        rates = self._turn(state.attitude, _attitude(force, target.yaw), target.yaw_rate)
        return self._mix(thrust, self._torque(state.rates, rates))

    def _accelerate(self, state: BodyState, target: SetPoint, dt_s: float) -> list[float]:
        """The acceleration towards the set point, without gravity."""
        wanted = []
        for i in range(3):
            off = target.position[i] - state.position[i]
            speed = target.velocity[i] + self.POSITION * max(-3.0, min(3.0, off))
            error = speed - state.velocity[i]
            total = self._integral[i] + self.VELOCITY_INTEGRAL * error * dt_s
            self._integral[i] = max(-self._LIMIT_M_S2, min(self._LIMIT_M_S2, total))
            wanted.append(target.acceleration[i] + self.VELOCITY * error + self._integral[i])
        return wanted

    def _to_force(self, acceleration: list[float]) -> Vector:
        """The force of the motors in the world, within the largest tilt."""
        ax, ay, az = acceleration
        up = max(az + GRAVITY, 0.3 * GRAVITY)
        aside = math.hypot(ax, ay)
        share = min(1.0, up * math.tan(_MAX_TILT) / aside) if aside > 1e-9 else 1.0
        mass = self._frame.mass
        return mass * ax * share, mass * ay * share, mass * up

    def _turn(self, attitude: Quat, wanted: Quat, yaw_rate: float) -> Vector:
        """Angular velocity in the body's axes towards the desired attitude."""
        w, x, y, z = multiply(conjugate(attitude), wanted)
        gain = 2 * self.ATTITUDE * (1 if w >= 0 else -1)
        up = rows(attitude)[2]
        return (
            gain * x + yaw_rate * up[0],
            gain * y + yaw_rate * up[1],
            0.4 * gain * z + yaw_rate * up[2],
        )

    def _torque(self, rates: Vector, wanted: Vector) -> Vector:
        """Torque about the body's axes, the gyroscopic part included."""
        (jx, jy, jz), (p, q, r) = self._frame.inertia, rates
        kx, ky, kz = self.RATES
        return (
            jx * kx * (wanted[0] - p) + (jz - jy) * q * r,
            jy * ky * (wanted[1] - q) + (jx - jz) * p * r,
            jz * kz * (wanted[2] - r) + (jy - jx) * p * q,
        )

    def _mix(self, thrust: float, torque: Vector) -> tuple[float, ...]:
        """The motors' thrusts; at their limits, yaw is sacrificed first."""
        top = self._frame.max_thrust
        tilt_x = torque[0] / (4 * self._frame.arm)
        tilt_y = torque[1] / (4 * self._frame.arm)
        spin = torque[2] / (4 * self._frame.drag)
        tilts = (tilt_x - tilt_y, -tilt_x - tilt_y, tilt_x + tilt_y, -tilt_x + tilt_y)
        lowest, highest = min(tilts), max(tilts)
        each = min(max(thrust / 4, -lowest), max(top - highest, 0.0))
        room = max(min(each + lowest, top - each - highest), 0.0)
        spin = max(-room, min(room, spin))
        spins = (spin, -spin, -spin, spin)
        return tuple(max(0.0, min(top, each + t + s)) for t, s in zip(tilts, spins, strict=True))


def _attitude(force: Vector, yaw: float) -> Quat:
    """The attitude with the z axis along the force and the x axis towards ``yaw``.

    Yaw about z, then pitch about the new y axis, then roll about the new x axis.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    ahead, left = c * force[0] + s * force[1], c * force[1] - s * force[0]
    pitch = math.atan2(ahead, force[2])
    roll = math.atan2(-left, math.hypot(ahead, force[2]))
    tilt = multiply(
        (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0),
        (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0),
    )
    return multiply(from_yaw(yaw), tilt)


def read_airframe(model: Any) -> Airframe:
    """Mass, inertia and motors of a quadrotor's model; the four motors are alike."""
    base, motor = model.body(BASE), model.site("motor_front_left")
    jx, jy, jz = base.inertia.tolist()
    return Airframe(
        mass=float(base.subtreemass[0]),
        inertia=(jx, jy, jz),
        arm=float(motor.pos[0]),
        drag=float(model.actuator_gear[0, 5]),
        max_thrust=float(model.actuator_ctrlrange[0, 1]),
    )
