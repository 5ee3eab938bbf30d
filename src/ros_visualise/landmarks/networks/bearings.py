"""Bearings of objects whose distance is unknown from one image."""

from __future__ import annotations

import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.landmarks.pose.rays import rays_of

_UNKNOWN = 1e6
"""Variance along the ray in m^2, and of the orientation in rad^2: both unknown."""

Bearing = tuple[Floats, Floats]
"""Position (3,) and its covariance (6, 6), of x, y, z and the rotations about them."""


def bearings(points_uv: Floats, covariances: Floats, info: CameraInfo) -> list[Bearing | None]:
    """Positions at one metre in the directions of pixels.

    Readers use the direction, and the covariance across it: in square metres at one metre.

    Args:
        points_uv: (N, 2) pixels of the image, origin at the centre of the top-left one.
        covariances: (N, 2, 2) of these, square pixels.
        info: the camera's calibration.

    Returns:
        For each point its bearing in the camera's optical frame; None if the camera model has no
            ray for it.

    Raises:
        UncalibratedCamera: no calibration.
        UnsupportedImage: unknown distortion model.
    """
    rays = rays_of(points_uv, info)
    return [
        (ray, _propagated(ray, to_pixels, covariance)) if np.isfinite(ray).all() else None
        for ray, to_pixels, covariance in zip(*rays, covariances, strict=True)
    ]


def _propagated(direction: Floats, to_pixels: Floats, covariance: Floats) -> Floats:
    """The pixel's covariance propagated to the plane across the ray (first order)."""
    to_plane = np.linalg.pinv(to_pixels)
    full = np.eye(6) * _UNKNOWN
    along = np.outer(direction, direction)
    full[:3, :3] = to_plane @ covariance @ to_plane.T + _UNKNOWN * along
    return full
