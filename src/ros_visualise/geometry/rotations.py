"""Rotations as unit quaternions ``quat_xyzw`` and 3x3 matrices, in float64.

All functions take arrays with any leading axes, which follow NumPy's rules of broadcasting. A
quaternion and its negative are the same rotation. ``a`` after ``b`` is ``multiply(a, b)``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_FLAT = 1 - 1e-12  # sine of a pitch at which roll and yaw turn about the same axis


def normalise(quat_xyzw: npt.ArrayLike) -> Floats:
    """Unit quaternions (..., 4).

    Raises:
        ValueError: one is zero, or no number.
    """
    quat = np.asarray(quat_xyzw, np.float64)
    norm = np.sqrt((quat * quat).sum(axis=-1, keepdims=True))
    if not (np.isfinite(norm) & (norm > 1e-9)).all():
        raise ValueError(
            "a quaternion of zeros, or with a value that is not a number, is not a rotation"
        )
    unit: Floats = quat / norm
    return unit


def multiply(a: npt.ArrayLike, b: npt.ArrayLike) -> Floats:
    """The rotations (..., 4) by ``b`` and then by ``a``: Hamilton's product."""
    ax, ay, az, aw = _columns(a)
    bx, by, bz, bw = _columns(b)
    product = (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
    return np.stack(product, axis=-1)


def inverse(quat_xyzw: npt.ArrayLike) -> Floats:
    """The opposite rotations (..., 4) of unit quaternions."""
    opposite: Floats = np.asarray(quat_xyzw, np.float64) * np.array([-1.0, -1.0, -1.0, 1.0])
    return opposite


def to_matrix(quat_xyzw: npt.ArrayLike) -> Floats:
    """Rotation matrices (..., 3, 3)."""
    x, y, z, w = _columns(normalise(quat_xyzw))
    return _filled(
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )


def from_matrix(matrix: npt.ArrayLike) -> Floats:
    """Unit quaternions (..., 4) with w >= 0 of rotation matrices (..., 3, 3).

    Source: S. W. Shepperd, Quaternion from Rotation Matrix, J. Guidance and Control 1 (1978).
    """
    m = np.asarray(matrix, np.float64)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    xy, xz, yz = (
        m[..., 0, 1] + m[..., 1, 0],
        m[..., 0, 2] + m[..., 2, 0],
        m[..., 1, 2] + m[..., 2, 1],
    )
    xw, yw, zw = (
        m[..., 2, 1] - m[..., 1, 2],
        m[..., 0, 2] - m[..., 2, 0],
        m[..., 1, 0] - m[..., 0, 1],
    )
    products = _filled(  # 4 q q^T: each row is the quaternion times a factor, the largest is best
        (1 + xx - yy - zz, xy, xz, xw),
        (xy, 1 - xx + yy - zz, yz, yw),
        (xz, yz, 1 - xx - yy + zz, zw),
        (xw, yw, zw, 1 + xx + yy + zz),
    )
    best = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    quat = normalise(np.take_along_axis(products, best[..., None, None], axis=-2)[..., 0, :])
    return np.where(quat[..., 3:] < 0, -quat, quat)


def from_rpy(rpy: npt.ArrayLike) -> Floats:
    """Unit quaternions (..., 4) of roll, pitch and yaw (..., 3) in radians.

    Rotations about the fixed axes x, y and z, in this order (REP 103).
    """
    half = np.asarray(rpy, np.float64) / 2
    roll, pitch, yaw = (
        np.stack([axis[0] * s, axis[1] * s, axis[2] * s, c], axis=-1)
        for axis, s, c in zip(
            np.eye(3),
            np.moveaxis(np.sin(half), -1, 0),
            np.moveaxis(np.cos(half), -1, 0),
            strict=True,
        )
    )
    return multiply(yaw, multiply(pitch, roll))


def to_rpy(quat_xyzw: npt.ArrayLike) -> Floats:
    """Roll, pitch and yaw (..., 3) in radians, pitch within +-pi/2.

    Where pitch is +-pi/2 roll and yaw are one: yaw is 0 then, as tf2 has it.
    """
    m = to_matrix(quat_xyzw)
    sine = np.clip(-m[..., 2, 0], -1, 1)
    flat = np.abs(sine) > _FLAT
    level = np.arctan2(m[..., 2, 1], m[..., 2, 2])
    upright = np.sign(sine) * np.arctan2(m[..., 0, 1], m[..., 1, 1])
    roll = np.where(flat, upright, level)
    yaw = np.where(flat, 0.0, np.arctan2(m[..., 1, 0], m[..., 0, 0]))
    return np.stack([roll, np.arcsin(sine), yaw], axis=-1)


def slerp(a: npt.ArrayLike, b: npt.ArrayLike, fraction: npt.ArrayLike) -> Floats:
    """Rotations (..., 4) on the shortest way from ``a`` to ``b`` at an even rate.

    Args:
        a, b: (..., 4).
        fraction: (...), 0 is ``a`` and 1 is ``b``.

    Source: K. Shoemake, Animating Rotation with Quaternion Curves, SIGGRAPH 1985, section 3.3.
    """
    start, end = normalise(a), normalise(b)
    end = np.where((start * end).sum(axis=-1, keepdims=True) < 0, -end, end)
    # by the chord, which is exact for small angles; at most pi/2, so that no sinc below is 0
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(end - start, axis=-1) / 2, 0, 1))
    part = np.asarray(fraction, np.float64)

    def weight(part: Floats) -> Floats:
        weight: Floats = part * np.sinc(part * angle / np.pi) / np.sinc(angle / np.pi)
        return weight[..., None]

    return normalise(weight(1 - part) * start + weight(part) * end)


def _columns(quat_xyzw: npt.ArrayLike) -> Floats:
    quat = np.asarray(quat_xyzw, np.float64)
    return quat if quat.ndim == 1 else np.moveaxis(quat, -1, 0)


def _filled(*rows: Sequence[Floats]) -> Floats:
    """Square matrices (..., n, n) of elements (...); many times faster than `np.stack`."""
    matrix = np.empty((*np.shape(rows[0][0]), len(rows), len(rows)))
    for number, row in enumerate(rows):
        for column, elements in enumerate(row):
            matrix[..., number, column] = elements
    return matrix
