"""One rigid motion as seven plain numbers, for chains of a few frames.

For single motions Python's numbers are ten times as fast as arrays. A `Pose` is T_parent_child:
x, y, z in metres, and a unit quaternion x, y, z, w.
"""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.data import Floats

Pose = tuple[float, float, float, float, float, float, float]

IDENTITY: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
_SMALLEST = 1e-9  # norm of a quaternion, and angle in radians that is turned evenly anyway


def pose(translation_xyz: Floats, quat_xyzw: Floats) -> Pose:
    """The motion, its quaternion normalised.

    Raises:
        ValueError: the quaternion is zero, or a value is not a number.
    """
    x, y, z = translation_xyz.tolist()
    a, b, c, d = quat_xyzw.tolist()
    norm = math.sqrt(a * a + b * b + c * c + d * d)
    if not math.isfinite(x + y + z + norm):
        raise ValueError("holds a value that is not a number")
    if norm < _SMALLEST:
        raise ValueError("has a quaternion of zeros")
    return x, y, z, a / norm, b / norm, c / norm, d / norm


def compose(first: Pose, second: Pose) -> Pose:
    """T_a_c of T_a_b and T_b_c."""
    x, y, z, ax, ay, az, aw = first
    px, py, pz, bx, by, bz, bw = second
    tx = 2 * (ay * pz - az * py)
    ty = 2 * (az * px - ax * pz)
    tz = 2 * (ax * py - ay * px)
    return (
        x + px + aw * tx + ay * tz - az * ty,
        y + py + aw * ty + az * tx - ax * tz,
        z + pz + aw * tz + ax * ty - ay * tx,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(motion: Pose) -> Pose:
    """T_b_a of T_a_b."""
    x, y, z, qx, qy, qz, qw = motion
    back = compose((0.0, 0.0, 0.0, -qx, -qy, -qz, qw), (-x, -y, -z, 0.0, 0.0, 0.0, 1.0))
    return (*back[:3], -qx, -qy, -qz, qw)


def interpolate(a: Pose, b: Pose, fraction: float) -> Pose:
    """The motion in between: along a line, and by the shortest rotation; see `rotations.slerp`."""
    ax, ay, az, a1, a2, a3, a4 = a
    bx, by, bz, b1, b2, b3, b4 = b
    if a1 * b1 + a2 * b2 + a3 * b3 + a4 * b4 < 0:
        b1, b2, b3, b4 = -b1, -b2, -b3, -b4
    chord = math.dist((a1, a2, a3, a4), (b1, b2, b3, b4))
    angle = 2 * math.asin(min(1.0, chord / 2))
    u, v = 1 - fraction, fraction
    if angle > _SMALLEST:
        sine = math.sin(angle)
        u, v = math.sin(u * angle) / sine, math.sin(v * angle) / sine
    return (
        ax + fraction * (bx - ax),
        ay + fraction * (by - ay),
        az + fraction * (bz - az),
        u * a1 + v * b1,
        u * a2 + v * b2,
        u * a3 + v * b3,
        u * a4 + v * b4,
    )


def to_matrix(motion: Pose) -> Floats:
    """T, 4x4."""
    px, py, pz, x, y, z, w = motion
    norm = x * x + y * y + z * z + w * w  # not quite 1 after a few products
    x2, y2, z2 = 2 * x / norm, 2 * y / norm, 2 * z / norm
    xx, yy, zz, xy, xz, yz = x * x2, y * y2, z * z2, x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    rows = (
        (1 - yy - zz, xy - wz, xz + wy, px),
        (xy + wz, 1 - xx - zz, yz - wx, py),
        (xz - wy, yz + wx, 1 - xx - yy, pz),
        (0.0, 0.0, 0.0, 1.0),
    )
    return np.array(rows)
