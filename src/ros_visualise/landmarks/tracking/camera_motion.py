"""Motion of the camera between two images: where pixels of the ground or the scene go."""

from __future__ import annotations

import cv2
import numpy as np

from ros_visualise.data import Floats, Pixels

_WIDTH = 480  # pixels, to which images are reduced
_POINTS = 250
_FEWEST = 10
_AGREE = 0.3  # least share of points that move with the camera
_NEAR_M = 0.2  # of the plane


class ImageMotion:
    """Motion by the images themselves: corners followed by optical flow, and what most of them do.

    Source: Aharon, Orfaig and Bobrovsky, BoT-SORT, 2022, section 3.2.

    Attributes:
        unknown: number of images whose motion was not found.
    """

    def __init__(self) -> None:
        self.unknown = 0
        self.forget()

    def forget(self) -> None:
        """Start over with the next image."""
        self._former: Pixels | None = None

    def step(self, gray: Pixels, boxes: Floats) -> Floats | None:
        """The motion since the last image, (3, 3); None if unknown.

        Args:
            gray: 8 bits.
            boxes: (N, 4) moving objects in the last image, which are left aside.
        """
        scale = min(1.0, _WIDTH / gray.shape[1])
        small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        former, self._former = self._former, small
        if former is None or former.shape != small.shape:
            return None
        found = _similarity(former, small, boxes * scale)
        if found is None:
            self.unknown += 1
            return None
        # reduced images have the same outer edges, not the same centre of the first pixel
        shift = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1]])
        whole: Floats = np.linalg.inv(shift) @ np.vstack((found, [0, 0, 1])) @ shift
        return whole


def _similarity(former: Pixels, now: Pixels, boxes: Floats) -> Floats | None:
    mask = np.full(former.shape, 255, np.uint8)
    center, half = boxes[:, :2], boxes[:, 2:] / 2
    for low, high in zip(center - half, center + half, strict=True):
        (left, top), (right, bottom) = np.clip((low, high), 0, former.shape[::-1]).astype(int)
        mask[top : bottom + 1, left : right + 1] = 0
    corners = cv2.goodFeaturesToTrack(former, _POINTS, 0.01, 6, mask=mask)
    if corners is None or len(corners) < _FEWEST:
        return None
    moved, is_found, _ = cv2.calcOpticalFlowPyrLK(former, now, corners, np.zeros_like(corners))
    good = is_found.ravel() > 0
    if good.sum() < _FEWEST:
        return None
    H, inliers = cv2.estimateAffinePartial2D(
        corners[good], moved[good], method=cv2.RANSAC, ransacReprojThreshold=1.5
    )
    if inliers is None or inliers.sum() < max(_FEWEST, _AGREE * good.sum()):
        return None
    return np.asarray(H, np.float64)


def ground_motion(
    K: Floats, T_fixed_former: Floats, T_fixed_now: Floats, ground_z: float
) -> Floats | None:
    """The motion of points of the ground, (3, 3), by the camera's poses; None if it is too near.

    Lens distortion is ignored. Source: Hartley and Zisserman, Multiple view geometry, 2004,
    equation 13.2.

    Args:
        K: (3, 3) calibration.
        T_fixed_former, T_fixed_now: (4, 4) poses of the camera, z up.
        ground_z: height of the ground in that frame, metres.
    """
    T = np.linalg.inv(T_fixed_now) @ T_fixed_former
    distance = ground_z - T_fixed_former[2, 3]
    if abs(distance) < _NEAR_M:
        return None
    normal = T_fixed_former[2, :3]  # the vertical in the axes of the former camera
    H: Floats = K @ (T[:3, :3] + np.outer(T[:3, 3], normal) / distance) @ np.linalg.inv(K)
    return H
