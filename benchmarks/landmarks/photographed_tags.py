"""Pictures of one tag each as a camera might take them, by another way than `rendered_tags`.

Each of 64 places in a pixel is looked up in the plane of the tag. Light falls unevenly; blur is
that of a lens, of being out of focus, or of motion; noise grows with the light; every second
picture is taken by a camera that curves its levels (gamma 2.2).
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from rendered_tags import Picture

from ros_visualise.data import CameraInfo
from ros_visualise.landmarks.pose.refinement import turn
from ros_visualise.landmarks.tags import draw_cells, family

FOCAL = 700.0
INFO = CameraInfo(600, 800, np.array([[FOCAL, 0, 401.3], [0, FOCAL, 297.1], [0, 0, 1]]))
SIZE_M = 0.15
_FINER, _AROUND_PX, _GAMMAS = 8, 16, (1.0, 2.2)


def pictures(side_px: float, tilt_deg: float, count: int, seed: int = 1) -> Iterator[Picture]:
    """Tags all over the image, turned and tilted to all sides."""
    rng = np.random.default_rng([seed, round(side_px), round(tilt_deg), 77])
    for number in range(count):
        about, roll = rng.uniform(0, 2 * np.pi, 2)
        tilt = np.array([np.cos(about), np.sin(about), 0]) * np.deg2rad(tilt_deg)
        R = turn(tilt) @ np.diag([1.0, -1, -1]) @ turn([0, 0, roll])
        t = np.array([*rng.uniform([-0.4, -0.3], [0.4, 0.3]), 1]) * FOCAL * SIZE_M / side_px
        yield _picture(R, t, int(rng.integers(587)), _GAMMAS[number % 2], rng)


def _picture(
    R: np.ndarray, t: np.ndarray, tag: int, gamma: float, rng: np.random.Generator
) -> Picture:
    square = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIZE_M / 2
    seen = (square @ R.T + t) @ INFO.K.T
    corners = seen[:, :2] / seen[:, 2:]
    first = np.floor(corners.min(axis=0) - _AROUND_PX).astype(int)
    width, height = np.ceil(corners.max(axis=0) + _AROUND_PX).astype(int) - first
    inside = (np.arange(_FINER) + 0.5) / _FINER - 0.5
    u, v = np.meshgrid(
        (first[0] + np.arange(width)[:, None] + inside).ravel(),
        (first[1] + np.arange(height)[:, None] + inside).ravel(),
    )
    light = _light(u, v, R, t, tag, rng)
    uneven = rng.uniform(-0.2, 0.2, 2)
    light *= 1 + uneven[0] * (u - u.mean()) / width + uneven[1] * (v - v.mean()) / height
    light = cv2.filter2D(light, -1, _blur(rng), borderType=cv2.BORDER_REPLICATE)
    pixels = light.reshape(height, _FINER, width, _FINER).mean(axis=(1, 3))
    variance = rng.uniform(0.002, 0.012) ** 2 + pixels * rng.uniform(0, 0.01) ** 2
    pixels = np.clip(pixels + rng.normal(size=pixels.shape) * np.sqrt(variance), 0, 1)
    gray = np.round(255 * pixels ** (1 / gamma)).astype(np.uint8)
    return Picture(gray, first, R, t, corners)


def _light(
    u: np.ndarray, v: np.ndarray, R: np.ndarray, t: np.ndarray, tag: int, rng: np.random.Generator
) -> np.ndarray:
    """What comes from the tag's plane at each place."""
    cells, rim = draw_cells(family("tag36h11"), tag)
    around = int(rng.integers(2))
    cells = np.pad(cells, around, constant_values=1)
    dark, bright, behind = rng.uniform([0.02, 0.5, 0.2], [0.15, 0.9, 0.6])
    cell_m = SIZE_M / (len(cells) - 2 * (rim + around))
    finer = max(2, round(FOCAL * cell_m / t[2] * _FINER))  # texels as large as places in a pixel
    levels = np.pad(np.where(cells, bright, dark), 2, constant_values=behind)
    texture = np.kron(levels, np.ones((finer, finer))).astype(np.float32)
    texel_m = cell_m / finer
    H = np.linalg.inv(INFO.K @ np.column_stack([R[:, 0], R[:, 1], t]))
    x, y, depth = (row[0] * u + row[1] * v + row[2] for row in H)
    middle = (len(texture) - 1) / 2
    column, row = middle + x / depth / texel_m, middle - y / depth / texel_m
    place = column.astype(np.float32), row.astype(np.float32)
    light = cv2.remap(texture, *place, cv2.INTER_LINEAR, borderValue=float(behind))
    return light.astype(np.float64)


def _blur(rng: np.random.Generator) -> np.ndarray:
    """A kernel: of a lens, of one out of focus, or of one that moves."""
    kind, reach = int(rng.integers(3)), 4 * _FINER
    v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1] / _FINER
    soft = rng.uniform([0.3, 0.35, 0.4], [1.1, 0.36, 0.7])[kind]
    kernel = np.exp(-(u * u + v * v) / (2 * soft * soft))
    if kind == 1:
        disk = (np.hypot(u, v) <= rng.uniform(0.5, 1.6)).astype(float)
        kernel = cv2.filter2D(kernel, -1, disk)
    if kind == 2:
        angle, length = rng.uniform(0, np.pi), rng.uniform(0.3, 1.2)
        shifts = np.linspace(-length / 2, length / 2, 25)[:, None, None]
        off_u, off_v = u - shifts * np.cos(angle), v - shifts * np.sin(angle)
        kernel = np.exp(-(off_u**2 + off_v**2) / (2 * soft * soft)).sum(axis=0)
    return kernel / kernel.sum()
