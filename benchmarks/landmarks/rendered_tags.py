"""Pictures of one tag 36h11 each, with its true pose."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np

from ros_visualise.data import CameraInfo
from ros_visualise.landmarks.pose.refinement import turn
from ros_visualise.landmarks.tags import draw_cells, family

FOCAL = 600.0
INFO = CameraInfo(480, 640, np.array([[FOCAL, 0, 319.5], [0, FOCAL, 239.5], [0, 0, 1]]))
SIZE_M = 0.2
BLURS_PX, NOISES = (0.3, 0.5, 0.75, 1.0), (1.0, 2.5, 5.0)
_FINER, _CELL, _AROUND_PX = 8, 32, 14


class Picture(NamedTuple):
    """``gray`` is the image, cut to what is near the tag: its first pixel is at ``origin_uv``."""

    gray: np.ndarray
    origin_uv: np.ndarray
    R: np.ndarray
    t: np.ndarray
    corners_uv: np.ndarray


def pictures(side_px: float, tilt_deg: float, count: int, seed: int = 1) -> Iterator[Picture]:
    """Tags all over the image, turned and tilted to all sides, with blurs and noises in turn."""
    rng = np.random.default_rng([seed, round(side_px), round(tilt_deg)])
    for number in range(count):
        about, roll = rng.uniform(0, 2 * np.pi, 2)
        tilt = np.array([np.cos(about), np.sin(about), 0]) * np.deg2rad(tilt_deg)
        R = turn(tilt) @ np.diag([1.0, -1, -1]) @ turn([0, 0, roll])
        t = np.array([*rng.uniform([-0.35, -0.25], [0.35, 0.25]), 1]) * FOCAL * SIZE_M / side_px
        blur, noise = BLURS_PX[number % 4], NOISES[number % 3]
        yield _picture(R, t, int(rng.integers(587)), blur, noise, rng)


def _picture(
    R: np.ndarray, t: np.ndarray, tag: int, blur: float, noise: float, rng: np.random.Generator
) -> Picture:
    cells, rim = draw_cells(family("tag36h11"), tag)
    levels = np.kron(np.pad(cells, 1, constant_values=1), np.ones((_CELL, _CELL)))
    picture = (30 + 170 * levels).astype(np.float32)
    in_square = len(cells) - 2 * rim
    scale, middle = in_square * _CELL / SIZE_M, (len(picture) - 1) / 2
    to_picture = np.array([[scale, 0, middle], [0, -scale, middle], [0, 0, 1]])
    to_image = INFO.K @ np.column_stack([R[:, 0], R[:, 1], t])
    square = np.array([[-1.0, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]]) * SIZE_M / 2
    square[:, 2] = 1
    seen = square @ to_image.T
    corners = seen[:, :2] / seen[:, 2:]
    first = np.floor(corners.min(axis=0) - _AROUND_PX).astype(int)
    width, height = np.ceil(corners.max(axis=0) + _AROUND_PX).astype(int) - first
    shift = (0.5 - first) * _FINER - 0.5
    to_fine = np.array([[_FINER, 0, shift[0]], [0, _FINER, shift[1]], [0, 0, 1.0]])
    H = to_fine @ to_image @ np.linalg.inv(to_picture)
    fine = cv2.warpPerspective(picture, H, (width * _FINER, height * _FINER), borderValue=110)
    gray = fine.reshape(height, _FINER, width, _FINER).mean(axis=(1, 3))
    gray = cv2.GaussianBlur(gray, (0, 0), blur) + rng.normal(size=gray.shape) * noise
    return Picture(np.clip(np.round(gray), 0, 255).astype(np.uint8), first, R, t, corners)
