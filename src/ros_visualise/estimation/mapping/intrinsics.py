"""Errors of a calibration, which all views of a camera share: they are estimated with the map.

A focal length that is 0.4 % too long makes distant tags 4 mm a metre too far, in every view.
Source: B. Triggs and others, Bundle Adjustment - A Modern Synthesis, 2000, section 2.
"""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.landmarks.pose.rays import rays_of
from ros_visualise.sources.calibration import CalibrationUncertainty
from ros_visualise.vision.rectification import distortion_of

_FOCAL, _ASPECT = 0.005, 0.005
"""Assumed standard deviation of focal length and principal point, as a fraction of the focal
length; and how little the two focal lengths differ in it."""
_BORDER_PX = 1.0  # by distortion, at the border of the image


def by_intrinsics(directions: Floats, info: CameraInfo) -> Floats:
    """(N, 2, 4 + n) derivatives of pixels by fx, fy, cx, cy and the n coefficients of distortion.

    Args:
        directions: (N, 3) rays in the camera's frame, z forward.
        info: its calibration.

    Raises:
        UnsupportedImage: unknown distortion model.
    """
    is_fisheye, D = distortion_of(info)
    own = directions @ info.R if info.R.any() else directions  # of the image, not rectified
    points, none = own[:, None], np.zeros(3)
    if is_fisheye:
        slopes = np.asarray(cv2.fisheye.projectPoints(points, none, none, info.K, D)[1])[:, :8]
    else:
        slopes = np.asarray(cv2.projectPoints(points, none, none, info.K, D)[1])[:, 6:]
    columns = np.asarray(slopes, np.float64)[:, : 4 + D.size]
    return np.nan_to_num(columns.reshape(len(points), 2, -1))


def assumed(info: CameraInfo) -> CalibrationUncertainty | None:
    """Errors that a calibration has if nothing is known of them; None if it is unusable.

    Focal lengths change together, and each coefficient of distortion moves a border of the image.
    """
    columns, rows = np.linspace(0, info.width - 1, 3), np.linspace(0, info.height - 1, 3)
    border = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    directions = rays_of(border, info).directions
    slopes = by_intrinsics(directions[np.isfinite(directions).all(axis=1)], info)
    if not len(slopes):
        return None
    farthest = np.abs(slopes).max(axis=(0, 1))
    sigmas = _BORDER_PX / np.maximum(farthest, _BORDER_PX)
    sigmas[:4] = _FOCAL * info.K[0, 0]
    covariance = np.diag(sigmas**2)
    covariance[0, 1] = covariance[1, 0] = (1 - _ASPECT) * sigmas[0] * sigmas[1]
    return CalibrationUncertainty(covariance, info)


def root_of(known: CalibrationUncertainty, info: CameraInfo) -> Floats:
    """(n, n) root of the covariance of a calibration, for images with this calibration.

    They may be smaller than those that the camera was calibrated with.
    """
    covariance, sigmas = known.covariance, known.deviations
    scale = np.ones(len(sigmas))
    scale[:4] = info.K[0, 0] / known.info.K[0, 0]
    free = np.where(sigmas > 0, sigmas, 1.0)
    variances, axes = np.linalg.eigh(covariance / np.outer(free, free))
    root: Floats = (scale * free)[:, None] * axes * np.sqrt(np.maximum(variances, 0))
    return root
