"""Pixels as rays of a calibrated camera, and the derivatives of pixels by rays."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import UncalibratedCamera
from ros_visualise.data import CameraInfo, Floats
from ros_visualise.vision.rectification import distortion_of

_ROUNDS = 20
_EXACT_PX = 1e-3


class Rays(NamedTuple):
    """Rays of pixels, in the camera's optical frame (z forward, x right, y down).

    A point p near a ray d is seen ``to_pixels @ p / (d @ p)`` pixels from that ray's pixel: exact
    for p on the ray, and to first order, distortion included, beside it.
    """

    directions: Floats
    """(..., 3) of length 1; NaN where the camera model has no ray for a pixel."""
    to_pixels: Floats
    """(..., 2, 3) derivative of the pixel by the direction."""


def rays_of(pixels_uv: npt.ArrayLike, info: CameraInfo) -> Rays:
    """The rays through pixels of the unrectified image.

    Args:
        pixels_uv: (..., 2), origin at the centre of the top-left pixel.
        info: the camera's calibration: K, D and R are used.

    Raises:
        UncalibratedCamera: no calibration.
        UnsupportedImage: unknown distortion model.
    """
    pixels = np.asarray(pixels_uv, np.float64)
    K = info.K
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise UncalibratedCamera("the camera is not calibrated; give a calibration file")
    is_fisheye, D = distortion_of(info)
    find = _fisheye_rays if is_fisheye else _pinhole_rays
    directions, to_pixels = find(pixels.reshape(-1, 2), K, D)
    turned = info.R if info.R.any() else np.eye(3)  # the frame of the rectified image
    shape = pixels.shape[:-1]
    return Rays(
        (directions @ turned.T).reshape(*shape, 3), (to_pixels @ turned.T).reshape(*shape, 2, 3)
    )


def _pinhole_rays(pixels: Floats, K: Floats, D: Floats) -> tuple[Floats, Floats]:
    """Rays by Newton's method: OpenCV's few fixed iterations are inexact for wide lenses."""
    if not len(pixels):
        return np.zeros((0, 3)), np.zeros((0, 2, 3))
    if not D.any():
        flat = (pixels - K[:2, 2]) / np.diag(K)[:2]
        length = np.sqrt(1 + (flat * flat).sum(axis=1))
        slopes = np.zeros((len(flat), 2, 3))
        slopes[:, 0, 0], slopes[:, 1, 1] = np.diag(K)[:2]
        slopes[:, :, 2] = -flat * np.diag(K)[:2]
        directions = np.column_stack([flat, np.ones(len(flat))])
        return directions / length[:, None], slopes * length[:, None, None]
    known = np.asarray(np.isfinite(pixels).all(axis=1))
    wanted = np.where(known[:, None], pixels, K[:2, 2])
    flat = cv2.undistortPoints(wanted[:, None], K, D).reshape(-1, 2).astype(np.float64)
    for _ in range(_ROUNDS):
        seen, slopes = _project(flat, K, D)
        step = _solve(slopes[:, :, :2], wanted - seen)
        flat = flat + np.where(np.isfinite(step), step, 0)
        if np.abs(step).max(initial=0, where=np.isfinite(step)) < 1e-12:
            break
    seen, slopes = _project(flat, K, D)
    # where the polynomial folds back, the image would be mirrored
    known &= (np.linalg.det(slopes[:, :, :2]) > 0) & (np.abs(seen - wanted).max(axis=1) < _EXACT_PX)
    directions = np.column_stack([flat, np.ones(len(flat))])
    length = np.linalg.norm(directions, axis=1)
    length[~known] = np.nan
    return directions / length[:, None], slopes * length[:, None, None]


def _project(flat: Floats, K: Floats, D: Floats) -> tuple[Floats, Floats]:
    """Pixels of points at z = 1, and their derivatives (N, 2, 3) by x, y and z."""
    points = np.column_stack([flat, np.ones(len(flat))])
    pixels, jacobian = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, D)
    slopes = np.asarray(jacobian, np.float64)[:, 3:6]
    return np.asarray(pixels, np.float64).reshape(-1, 2), slopes.reshape(-1, 2, 3)


def _solve(matrices: Floats, values: Floats) -> Floats:
    (a, b), (c, d) = np.moveaxis(matrices, 0, -1)
    x, y = values.T
    with np.errstate(divide="ignore", invalid="ignore"):
        solved: Floats = np.stack([d * x - b * y, a * y - c * x], axis=1)
        solved /= (a * d - b * c)[:, None]
    return solved


def _fisheye_rays(pixels: Floats, K: Floats, D: Floats) -> tuple[Floats, Floats]:
    """Rays of the equidistant model, also beyond 90 degrees.

    Source: J. Kannala, S. Brandt, A Generic Camera Model and Calibration Method, 2006, eq. 6.
    """
    focal = np.diag(K)[:2]
    plane = np.where(np.isfinite(pixels), pixels - K[:2, 2], np.nan) / focal
    radius = np.linalg.norm(plane, axis=1)
    angle, slope = _angle_of(radius, D)
    safe = np.where(radius > 0, radius, 1.0)
    cos_phi, sin_phi = np.where(radius > 0, plane.T / safe, [[1.0], [0.0]])
    sine, cosine, none = np.sin(angle), np.cos(angle), np.zeros(len(pixels))
    directions = np.stack([sine * cos_phi, sine * sin_phi, cosine], axis=1)
    outward = np.stack([cosine * cos_phi, cosine * sin_phi, -sine], axis=1)
    around = np.stack([-sin_phi, cos_phi, none], axis=1)
    across = np.where(radius > 0, radius / np.where(sine > 0, sine, 1.0), 1.0)
    to_plane = (
        np.stack([cos_phi, sin_phi], axis=1)[:, :, None] * (slope[:, None] * outward)[:, None]
    )
    to_plane += around[:, :2, None] * (across[:, None] * around)[:, None]
    return directions, to_plane * focal[:, None]


def _angle_of(radius: Floats, D: Floats) -> tuple[Floats, Floats]:
    """Angles from the optical axis, and the derivative of the radius; NaN if unsolvable."""
    powers = np.array([1.0, *D])
    orders = np.arange(5) * 2

    def polynomial(angle: Floats) -> tuple[Floats, Floats]:
        even = powers * angle[:, None] ** orders
        return angle * even.sum(axis=1), even @ (orders + 1)

    angle = np.minimum(radius, np.pi)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(_ROUNDS):
            value, slope = polynomial(angle)
            angle = np.clip(angle - (value - radius) / slope, 0, np.pi)
        value, slope = polynomial(angle)
        found = (np.abs(value - radius) < 1e-9) & (slope > 0)
    return np.where(found, angle, np.nan), slope
