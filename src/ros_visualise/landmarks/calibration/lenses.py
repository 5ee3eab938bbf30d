"""Lens models: projection of board points, and its derivatives by each number of the camera.

A camera's numbers are ``fx, fy, cx, cy`` and the coefficients of its model.

Source: OpenCV's pinhole and fisheye models; sensor_msgs/CameraInfo has their ROS names.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats
from ros_visualise.vision.reshape import Size


class Lens(Enum):
    """Lens models to choose from."""

    PINHOLE = "pinhole"
    RATIONAL = "rational"
    FISHEYE = "fisheye"


@dataclass(frozen=True)
class LensModel:
    """A distortion model.

    ``name`` is its ROS name; ``coefficients`` are those of ``D``, in order.
    """

    lens: Lens
    name: str
    coefficients: tuple[str, ...]

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of the camera's numbers."""
        return ("fx", "fy", "cx", "cy", *self.coefficients)

    @property
    def is_fisheye(self) -> bool:
        """True if it distorts angles instead of slopes."""
        return self.lens is Lens.FISHEYE


MODELS = {
    Lens.PINHOLE: LensModel(Lens.PINHOLE, "plumb_bob", ("k1", "k2", "p1", "p2", "k3")),
    Lens.RATIONAL: LensModel(
        Lens.RATIONAL, "rational_polynomial", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    ),
    Lens.FISHEYE: LensModel(Lens.FISHEYE, "equidistant", ("k1", "k2", "k3", "k4")),
}


def project(
    points_xyz: Floats, pose: Floats, numbers: Floats, model: LensModel
) -> tuple[Floats, Floats, Floats]:
    """Pixels of points, and their derivatives.

    Args:
        points_xyz: (N, 3) in the board's frame.
        pose: (6,) of the board in the camera's frame: rotation vector, translation.
        numbers: of the camera.
        model: of the lens.

    Returns:
        uv (N, 2); derivatives by the camera's numbers (2N, n); by the pose (2N, 6).
    """
    K, D = matrix(numbers), numbers[4:]
    points, turn, move = points_xyz[:, None], pose[:3].copy(), pose[3:].copy()
    if model.is_fisheye:
        uv, by = cv2.fisheye.projectPoints(points, turn, move, K, D)
        own, outer = by[:, :8], by[:, 8:14]
    else:
        uv, by = cv2.projectPoints(points, turn, move, K, D)
        own, outer = by[:, 6:], by[:, :6]
    uv, own, outer = (np.asarray(one, np.float64) for one in (uv, own, outer))
    return uv.reshape(-1, 2), own, outer


def to_rays(uv: Floats, numbers: Floats, model: LensModel) -> Floats:
    """Slopes x/z, y/z (N, 2) of the rays through pixels."""
    undistort = cv2.fisheye.undistortPoints if model.is_fisheye else cv2.undistortPoints
    rays = undistort(uv[:, None], matrix(numbers), numbers[4:])
    return np.asarray(rays, np.float64).reshape(-1, 2)


def matrix(numbers: Floats) -> Floats:
    """K, 3x3."""
    fx, fy, cx, cy = numbers[:4]
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])


def to_info(numbers: Floats, model: LensModel, size: Size) -> CameraInfo:
    """The ROS calibration, with P = K."""
    return CameraInfo(
        height=size[1],
        width=size[0],
        K=matrix(numbers),
        D=numbers[4:].copy(),
        distortion_model=model.name,
    )
