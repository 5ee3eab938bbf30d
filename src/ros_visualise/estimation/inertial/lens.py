"""Errors of the lens: constants that are estimated with the robot.

A calibration gives directions z of pixels, at z = 1; the true ones are

    h = z exp(-a - k |z|^2) - r s,

with ``a`` the error of the focal length (``f exp(a)`` instead of ``f``), ``k`` the error of the
radial distortion, and ``r s`` the shift of directions by a rolling shutter (see `readout` and
`jumps`). Small errors of any lens model have about this form; if the calibration states a
distortion, ``k`` is the error that remains. A wrong principal point looks like a rotated camera.

*Derivatives* are taken at the expected directions. At the measured ones, they would be correlated
with the noise, and the estimate would run away, as all residuals shrink with a longer focal length
(in a simulated flight it ended 80% too long). Expected directions depend only on differences
between poses, so a motion of the whole map does not change them, and linearization adds no false
information about it.

*Observability.* In the image, a rotation moves points by the angle from the gyroscope or gimbal,
and a climb moves them by ``v / d``, with ``v`` from the IMU. Both are multiplied by the focal
length, and so show it. A level flight over flat ground does not: a longer focal length with
larger depths gives the same images, and this must hold at every estimate. So a point of the state
is the direction that the calibration gives, which stays the same, and the logarithm of its inverse
depth, which changes by ``-a`` for all points. With true directions and inverse depths instead, a
correct focal length was estimated 7% too long, 8 standard deviations off.

Source: M. Li et al., High-fidelity sensor modeling and self-calibration in vision-aided inertial
navigation, ICRA 2014 (the states); G. Huang et al., Observability-based rules for designing
consistent EKF SLAM estimators, IJRR 2010 (directions that must stay unknown).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.estimation.inertial.readout import Readout
from ros_visualise.estimation.settings import CameraErrors

COUNT = 4
"""Readout, that of `jumps`, focal length and radial distortion."""
FOCAL, RADIAL = 2, 3
"""Places of the last two."""
FOCAL_SIGMA = 0.03
"""Standard deviation of the focal length if none is stated. A good calibration is within 0.5%,
but a message does not say how good it is. The error is estimated, so a large value costs little.
"""
_RADIAL = 5 / 3  # standard deviation of k, as a multiple of that of a
_WRONG = 1.0  # standard deviations before the flight,
_KNOWN = 3.0  # and after it, by which an error is reported: 1.6 of the latter are usual
_FARTHEST = 1.2  # |z|^2, 48 degrees from the axis: farther out, the error of distortion stays
_LEAST_INVERSE = 1e-6  # 1/m
_ROUNDS = 12


def shifts_of(expected: Floats, slips: Floats) -> Floats:
    """Derivatives (..., 2, 4) of measured directions by the errors of the lens.

    Args:
        expected: (..., 2) directions at z = 1.
        slips: (..., 2, 2), see `readout`.
    """
    shaped = np.stack([expected, expected * _far(expected)], axis=-1)
    return np.concatenate([slips, shaped], axis=-1)


def corrected(rays: Floats, slips: Floats, errors: Floats) -> Floats:
    """Directions (..., 2) without the errors (4,) of the lens."""
    scale = np.exp(-errors[FOCAL] - errors[RADIAL] * _far(rays))
    true: Floats = rays * scale - slips @ errors[:FOCAL]
    return true


def _far(rays: Floats) -> Floats:
    """(..., 1) squares of the distances from the axis, at z = 1."""
    far: Floats = np.minimum((rays**2).sum(axis=-1, keepdims=True), _FARTHEST)
    return far


def values_of(points: Floats, errors: Floats) -> tuple[Floats, Floats, Floats]:
    """True directions and inverse depths of points, see the module.

    Args:
        points: (N, 3) directions that the calibration gives, and logarithms of inverse depths.
        errors: (4,) of the lens.

    Returns:
        (N, 3) values, and their derivatives (N, 3, 3) by the points and (N, 3, 4) by the errors.
    """
    raw, far = points[:, :2], _far(points[:, :2])
    scale = np.exp(-errors[FOCAL] - errors[RADIAL] * far)
    values = np.column_stack([raw * scale, np.exp(points[:, 2])])
    by_point, by_errors = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3, COUNT))
    across = raw[:, :, None] * raw[:, None] * (far < _FARTHEST)[..., None]
    by_point[:, :2, :2] = scale[..., None] * (np.eye(2) - 2 * errors[RADIAL] * across)
    by_point[:, 2, 2] = values[:, 2]
    by_errors[:, :2, FOCAL] = -values[:, :2]
    by_errors[:, :2, RADIAL] = -values[:, :2] * far
    return values, by_point, by_errors


def points_of(values: Floats, errors: Floats) -> Floats:
    """Points (N, 3) by their values (N, 3): the inverse of `values_of`."""
    raw = values[:, :2]
    for _ in range(_ROUNDS):
        raw = values[:, :2] * np.exp(errors[FOCAL] + errors[RADIAL] * _far(raw))
    return np.column_stack([raw, np.log(np.maximum(values[:, 2], _LEAST_INVERSE))])


def radial_of(focal: float) -> float:
    """Standard deviation of the radial distortion by that of the focal length."""
    return _RADIAL * focal


def first_lens(readout: Readout, camera: CameraErrors) -> tuple[Floats, Floats]:
    """Errors (4,) of the lens that are expected, and their covariance (4, 4)."""
    seconds, sigma_s = readout
    jumps = sigma_s + seconds / 2 if camera.turn_s else 0.0  # anything from 0 to the readout
    expected = np.array([seconds, bool(jumps) * seconds / 2, 0.0, 0.0])
    return expected, np.diag(np.square([sigma_s, jumps, camera.focal, radial_of(camera.focal)]))


class LensErrors(NamedTuple):
    """Errors of focal length and radial distortion (2,), and their standard deviations (2,)."""

    values: Floats
    sigmas: Floats

    def words(self, info: CameraInfo) -> str:
        """The focal length, as text."""
        focal = _focal_px(info) * np.exp(self.values[0])
        return f"{focal:.0f} px, +-{focal * self.sigmas[0]:.0f}"

    def fault(self, info: CameraInfo, focal: float) -> str:
        """A warning if the calibration, of standard deviation ``focal``, is wrong; else empty."""
        stated = np.array([focal, radial_of(focal)])
        off = np.abs(self.values)
        is_wrong = (off > _WRONG * stated) & (off > _KNOWN * self.sigmas)
        if is_wrong[0]:
            what = f"a focal length of {self.words(info)}, not {_focal_px(info):.0f} px"
        elif is_wrong[1]:
            what = f"a different lens distortion (k1 differs by {self.values[1]:+.2f})"
        else:
            return ""
        return f"the images fit {what}: calibrate the camera (ros-visualise calibrate)"


def _focal_px(info: CameraInfo) -> float:
    return float(np.sqrt(info.K[0, 0] * info.K[1, 1]))
