"""Jumps: rotations of the camera from view to view that neither the IMU nor tf explains.

A gimbal's attitude on tf has another error in each image. How that shifts the rows of a rolling
shutter depends on its cause. If the camera rotates smoothly and tf does not say so, rows are
shifted by all of the flow, as `readout` describes. If only tf errs, the flow does not show it. But
if the camera jumps between images, and stays while one is read, the flow shows the jump, which
shifts no rows. So a sighting slips by

    y (r u - j w),

with the flow ``u``, its part ``w`` by jumps, and an unknown ``j``: 0 in the first two cases, and
``r`` in the last. Both are estimated.

Without ``j``, jumps of 0.2 degrees (the simulator's profile `hard`, with a readout of 30 ms)
stretch each image by an amount that is correlated with its rotation. A correct focal length was
estimated 2 to 4% too long then, 5 standard deviations off, and the readout was 24 to 27 ms.

*The jump* of an image is the rotation that fits best to what the points of the state show, before
they correct it.
"""

from __future__ import annotations

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.settings import CameraErrors

_LEAST = 6  # points
_ROUNDS = 3
_ALIKE = 2.0  # times the noise of a corner, as poses and points err, too


def turned(rays: Floats) -> Floats:
    """Derivatives (..., 2, 3) of directions at z = 1 by rotations of the camera about its axes."""
    x, y = rays[..., 0], rays[..., 1]
    by = np.stack([x * y, -1 - x**2, y, 1 + y**2, -x * y, -x], axis=-1)
    return by.reshape(*x.shape, 2, 3)


def jump_of(expected: Floats, residual: Floats, sigma: float, largest: float) -> Floats:
    """The rotation (3,) of the camera, rad, that explains residuals (N, 2) of directions.

    Args:
        expected: (N, 2) directions at z = 1.
        residual: (N, 2) measured minus expected.
        sigma: standard deviation of a measured direction.
        largest: that of the rotation.
    """
    jump = np.zeros(3)
    if len(expected) < _LEAST or not largest:
        return jump
    J, weights = turned(expected), np.ones(len(expected))
    for _ in range(_ROUNDS):
        A = (J * weights[:, None, None]).reshape(-1, 3)
        N = A.T @ A + np.eye(3) * (_ALIKE * sigma / largest) ** 2
        jump = np.linalg.solve(N, A.T @ (residual * weights[:, None]).ravel())
        off = np.linalg.norm(residual - J @ jump, axis=1)
        weights = 1 / np.sqrt(1 + (off / max(_ALIKE * sigma, float(np.median(off)))) ** 2)
    return jump


def largest_jump(errors: CameraErrors, seconds: float) -> float:
    """Standard deviation of the change of the camera's attitude within a time, rad."""
    if not errors.turn_s:
        return 0.0
    return errors.turn_rad * float(np.sqrt(2 * -np.expm1(-seconds / errors.turn_s)))
