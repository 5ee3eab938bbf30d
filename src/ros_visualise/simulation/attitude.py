"""Rotations as plain numbers, for code that runs hundreds of times a second.

A quaternion is (w, x, y, z), as in MuJoCo. `ros_visualise.geometry.rotations` does the same for
arrays of any shape, but takes at least thirty times as long for a single rotation.
"""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats

Vector = tuple[float, float, float]
Quat = tuple[float, float, float, float]


def multiply(a: Quat, b: Quat) -> Quat:
    """The rotation by ``b`` and then by ``a``."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def conjugate(q: Quat) -> Quat:
    """The inverse rotation."""
    return q[0], -q[1], -q[2], -q[3]


def from_yaw(yaw: float) -> Quat:
    """A rotation about z, radians."""
    return math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)


def from_rotation_vector(x: float, y: float, z: float) -> Quat:
    """A rotation about the vector by its length, radians."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return 1.0, 0.0, 0.0, 0.0
    s = math.sin(angle / 2) / angle
    return math.cos(angle / 2), s * x, s * y, s * z


def yaw_of(q: Quat) -> float:
    """Heading of the x axis, radians from -pi to pi."""
    w, x, y, z = q
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def wrap(angle: float) -> float:
    """The same angle from -pi to pi."""
    return math.remainder(angle, 2 * math.pi)


def rows(q: Quat) -> tuple[Vector, Vector, Vector]:
    """The rotation matrix, row by row."""
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def xyzw(q: Quat) -> Floats:
    """The quaternion in the order of ROS's messages, (4,)."""
    return np.array((q[1], q[2], q[3], q[0]))
