"""Projecting points into the image of a camera."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import CameraInfo, Floats

MODELS = ("plumb_bob", "rational_polynomial", "equidistant", "")
"""The distortion models that can be projected, as sensor_msgs/CameraInfo names them."""
_NEAR = 1e-3
_FOV_MARGIN = 1.5  # beyond the image's corner, where distortion polynomials mean nothing


def project(
    points_xyz: npt.NDArray[np.floating], info: CameraInfo, rectified: bool = False
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Pixels of points, and which of them are in front of the camera.

    A point far outside the image is not in front either: there, a polynomial for the distortion
    may fold back into the image.

    Args:
        points_xyz: (N, 3) metres in the camera's optical frame: x right, y down, z forward; of a
            stereo pair, in that of its first camera, rectified.
        info: its calibration.
        rectified: the image is rectified, so that P holds; else K, D and R do.

    Returns:
        pixels_uv (N, 2), origin at the centre of the top-left pixel, zero where not in front;
        in_front (N,).

    Raises:
        ValueError: the camera is not calibrated, or its distortion model is not one of `MODELS`.

    Source: sensor_msgs/CameraInfo; OpenCV's pinhole and fisheye models.
    """
    if info.distortion_model not in MODELS:
        raise ValueError(f"unsupported distortion model {info.distortion_model!r}")
    use_P = rectified and info.P is not None
    P = info.P if use_P else np.hstack([info.K, np.zeros((3, 1))])
    assert P is not None
    if P[0, 0] <= 0 or P[1, 1] <= 0:
        raise ValueError("the camera is not calibrated")
    is_fisheye = info.distortion_model == "equidistant"
    K, D = P[:, :3], None if use_P or not (is_fisheye or np.any(info.D)) else info.D
    in_front = np.isfinite(points_xyz).all(axis=1)
    points = points_xyz[in_front].astype(np.float64)
    points = points + np.linalg.solve(K, P[:, 3]) if use_P else points @ info.R
    seen = points[:, 2] > _NEAR
    if D is not None and not is_fisheye:
        seen &= _is_near_the_view(points, K, info)
    in_front[in_front] = seen
    pixels = np.zeros((len(points_xyz), 2))
    pixels[in_front] = _to_pixels(points[seen], K, D, info)
    return pixels, in_front


def _to_pixels(points: Floats, K: Floats, D: Floats | None, info: CameraInfo) -> Floats:
    if D is None or not len(points):
        flat: Floats = points[:, :2] / points[:, 2:] * [K[0, 0], K[1, 1]] + K[:2, 2]
        flat[:, 0] += K[0, 1] * points[:, 1] / points[:, 2]
        return flat
    none = np.zeros(3)
    if info.distortion_model == "equidistant":
        found, _ = cv2.fisheye.projectPoints(points[:, None], none, none, K, D[:4])
    else:
        found, _ = cv2.projectPoints(points, none, none, K, D)
    return np.asarray(found, np.float64).reshape(-1, 2)


def _is_near_the_view(points: Floats, K: Floats, info: CameraInfo) -> npt.NDArray[np.bool_]:
    """Within the rays through the image's corners, and a margin, as if nothing were distorted."""
    corners = np.array([[0, 0], [info.width, 0], [0, info.height], [info.width, info.height]])
    reach = np.abs((corners - K[:2, 2]) / [K[0, 0], K[1, 1]]).max(axis=0) * _FOV_MARGIN
    near: npt.NDArray[np.bool_] = (np.abs(points[:, :2]) <= reach * points[:, 2:]).all(axis=1)
    return near
