"""Lens and shutter of a camera: warps the image of an ideal camera into what the sensor gets.

Each row is exposed at its own time. A pixel at a time shows the point on its ray, which the ideal
image, taken at the stamp, has elsewhere: where that point was seen from there follows from its
depth and the camera's motion, to first order. Motion blur is the mean of such images over the
exposure. The scene counts as still.

Source: Longuet-Higgins and Prazdny, The interpretation of a moving retinal image, 1980.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.data import CameraInfo, Floats, Pixels

Map = npt.NDArray[np.float32]

_MOVING_PX = 24  # margin of the ideal image for motion
_BORDER_POINTS = 64
_EXACT_PX = 1e-3
_ITERATIONS = 50
_MOST_TAPS = 16  # of an image that is blurred


def ideal_size(info: CameraInfo, moves: bool) -> tuple[int, int]:
    """(width, height) of an ideal image with the same focal length that has all rays of a camera.

    Args:
        info: the camera's calibration, its principal point in the centre.
        moves: True if rows may need rays beside these.

    Raises:
        OpenError: some pixels have no ray.
    """
    size = np.array([info.width, info.height])
    if np.any(info.D):
        along = np.linspace(0, 1, _BORDER_POINTS)[:, None] * (size - 1)
        x, y = along.T
        zero = np.zeros_like(x)
        sides = ((x, zero), (x, zero + size[1] - 1), (zero, y), (zero + size[0] - 1, y))
        rays = np.abs(_rays(info, np.concatenate([np.stack(side, axis=1) for side in sides])))
        size = np.maximum(size, 2 * np.ceil(rays.max(axis=0) * info.K[0, 0]).astype(int) + 2)
    width, height = (size + 2 * _MOVING_PX * moves).tolist()
    return width + (width - info.width) % 2, height + (height - info.height) % 2


def _rays(info: CameraInfo, pixels: Floats) -> Floats:
    """(N, 2) rays of pixels, at a distance of 1.

    Raises:
        OpenError: some have none.
    """
    given = np.ascontiguousarray(pixels, np.float64).reshape(-1, 1, 2)
    rays = cv2.undistortPoints(given, info.K, info.D)
    for _ in range(_ITERATIONS):  # its own are few
        ahead = cv2.convertPointsToHomogeneous(rays)
        again, _ = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), info.K, info.D)
        off = given - again
        if np.abs(off).max() < _EXACT_PX:
            return np.asarray(rays[:, 0])
        rays = rays + off / info.K[0, 0]
    raise OpenError(
        "some pixels see nothing with this lens distortion: choose smaller camera_k1 ... camera_k3,"
        " or a smaller camera_fov"
    )


class Optics:
    """Lens and shutter of one camera.

    Args:
        info: its calibration.
        readout_s: time from the exposure of the first row to that of the last.
        exposure_s: of each row.
    """

    def __init__(self, info: CameraInfo, readout_s: float, exposure_s: float) -> None:
        self.moves = readout_s > 0 or exposure_s > 0
        self.size = ideal_size(info, self.moves)
        self._focal, self._exposure_s = float(info.K[0, 0]), exposure_s
        self._shape = info.height, info.width
        v, u = np.mgrid[: info.height, : info.width]
        pixels = np.stack([u.ravel(), v.ravel()], axis=1)
        self._is_bent = bool(np.any(info.D))
        rays = _rays(info, pixels) if self._is_bent else (pixels - info.K[:2, 2]) / self._focal
        x, y = (np.ascontiguousarray(part.reshape(u.shape), np.float32) for part in rays.T)
        self._x, self._y = x, y
        centre = (np.array(self.size) - 1) / 2
        self._map = self._focal * x + np.float32(centre[0]), self._focal * y + np.float32(centre[1])
        rows = np.arange(info.height, dtype=np.float32)[:, None] / max(info.height - 1, 1)
        self._times_s = np.float32(readout_s) * (rows - np.float32(0.5))

    def see(
        self, ideal: Pixels, inverse_depth: Map | None, motion: tuple[Floats, Floats]
    ) -> Pixels:
        """The image of the sensor.

        Args:
            ideal: image of an ideal camera of `size` at the stamp.
            inverse_depth: 1/m, of its pixels; None: nothing moves.
            motion: linear and angular velocity of the camera in its own axes, (3,) each.
        """
        if inverse_depth is None:
            return self._sample(ideal, *self._map) if self._is_bent else self._middle(ideal)
        flow_x, flow_y = self._flow(inverse_depth, *motion)
        blur_px = self._exposure_s * float(max(np.abs(flow_x).max(), np.abs(flow_y).max()))
        taps = min(max(math.ceil(blur_px), 1), _MOST_TAPS)
        total = np.zeros((*self._shape, 3), np.uint16)
        for tap in range(taps):
            times = self._times_s + np.float32(self._exposure_s * ((tap + 0.5) / taps - 0.5))
            x, y = self._map[0] + times * flow_x, self._map[1] + times * flow_y
            cv2.add(total, self._sample(ideal, x, y), total, dtype=cv2.CV_16U)
        return np.asarray(cv2.convertScaleAbs(total, alpha=1 / taps))

    def _flow(self, inverse_depth: Map, linear: Floats, angular: Floats) -> tuple[Map, Map]:
        """Motion of each pixel's place in the ideal image with the time of its exposure, px/s."""
        x, y, f = self._x, self._y, np.float32(self._focal)
        near = cv2.remap(inverse_depth, *self._map, cv2.INTER_NEAREST, None, cv2.BORDER_REPLICATE)
        wx, wy, wz = np.asarray(angular, np.float32)
        vx, vy, vz = np.asarray(linear, np.float32)
        ahead = wx * y - wy * x + vz * near
        flow_x = f * (wy - wz * y + vx * near - x * ahead)
        flow_y = f * (wz * x - wx + vy * near - y * ahead)
        return flow_x, flow_y

    def _sample(self, ideal: Pixels, x: Map, y: Map) -> Pixels:
        border = cv2.BORDER_REPLICATE
        return np.asarray(cv2.remap(ideal, x, y, cv2.INTER_LINEAR, None, border))

    def _middle(self, ideal: Pixels) -> Pixels:
        (height, width), (whole, wide) = self._shape, ideal.shape[:2]
        top, left = (whole - height) // 2, (wide - width) // 2
        return ideal[top : top + height, left : left + width]
