"""Which of a lidar's rays can meet a thing at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.simulation.engine import load_mujoco

_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_SLACK_RAD = 1e-4


class Silhouettes:
    """Rectangles of rows and columns that the world's things fill, seen from somewhere.

    They are made of the corners of the things' bounding boxes: too large rather than too small.

    Args:
        elevations: (rows,) rad, rising.
        columns: of a row, the first looking to azimuth -pi.
        far_m: beyond it nothing is seen.
    """

    def __init__(self, model: Any, elevations: Floats, columns: int, far_m: float) -> None:
        still = (model.geom_bodyid == 0) & (model.geom_group == 0) & (model.geom_type != _PLANE)
        self._corners = _box_corners(model, np.flatnonzero(still))
        self._elevations, self._columns, self._far_m = elevations, columns, far_m

    def cover(self, position_xyz: Floats, R: Floats, ground_m: Floats) -> npt.NDArray[np.bool_]:
        """(rows * columns,) whether a ray may meet a thing before the ground.

        Args:
            ground_m: (rows * columns,) range to the ground along each ray.
        """
        rows, columns = len(self._elevations), self._columns
        corners = (self._corners - position_xyz) @ R
        near, left, right, low, high = _extent(corners)
        seen = np.flatnonzero(near < self._far_m)
        first = np.floor((left + np.pi) * columns / (2 * np.pi)).astype(int)
        last = np.ceil((right + np.pi) * columns / (2 * np.pi)).astype(int) + 1
        bottom = np.searchsorted(self._elevations, low - _SLACK_RAD)
        top = np.searchsorted(self._elevations, high + _SLACK_RAD)
        nearest = np.full((rows, columns), np.inf)
        for i in seen[np.argsort(-near[seen])]:  # the nearest is written last
            part = slice(bottom[i], top[i])
            a, b = first[i], last[i]
            if b - a >= columns:
                nearest[part] = near[i]
            elif a < 0 or b > columns:
                nearest[part, a % columns :] = near[i]
                nearest[part, : b % columns] = near[i]
            else:
                nearest[part, a:b] = near[i]
        return np.asarray(nearest.ravel() < ground_m)


_PLANE = 0  # mjGEOM_PLANE


def _box_corners(model: Any, geoms: npt.NDArray[np.intp]) -> Floats:
    """(N, 8, 3) in the world. Geoms of the world's own body never move."""
    mujoco = load_mujoco()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    boxes = model.geom_aabb[geoms]
    local = boxes[:, None, :3] + _CORNERS * boxes[:, None, 3:]
    axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
    return np.asarray(local @ axes.transpose(0, 2, 1) + data.geom_xpos[geoms][:, None])


def _extent(corners: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Shortest range, azimuths from and to, elevations from and to, (N,) each, of (N, 8, 3)."""
    middle = corners.mean(axis=1)
    aside = np.linalg.norm(corners[..., :2] - middle[:, None, :2], axis=-1).max(axis=1)
    away = np.hypot(middle[:, 0], middle[:, 1])
    level_near, level_far = np.maximum(away - aside, 1e-6), away + aside
    below, above = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
    low = np.arctan2(below, np.where(below < 0, level_near, level_far))
    high = np.arctan2(above, np.where(above > 0, level_near, level_far))
    heading = np.arctan2(middle[:, 1], middle[:, 0])
    bearing = np.arctan2(corners[..., 1], corners[..., 0]) - heading[:, None]
    bearing = np.mod(bearing + np.pi, 2 * np.pi) - np.pi
    around = away <= aside
    left = heading + np.where(around, -np.pi, bearing.min(axis=1))
    right = heading + np.where(around, np.pi, bearing.max(axis=1))
    height = np.maximum(np.maximum(below, -above), 0)
    return np.hypot(np.where(around, 0, level_near), height), left, right, low, high
