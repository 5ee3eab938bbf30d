"""Which of a lidar's rays can hit which geoms at all."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_SLACK_RAD = 1e-4


class RayCulling:
    """Finds the rows and columns of rays that can hit each geom's bounding box.

    A few rays too many are found, never too few.

    Args:
        boxes: (G, 6) centre and half sides of each geom's bounding box in its own axes.
        places, axes: (G, 3) and (G, 9) position and rotation of each geom in the world.
        elevations: (rows,) of the rows of rays, rad, rising.
        columns: rays in a row, the first at azimuth -pi.
        far_m: geoms farther than this are not seen.
    """

    def __init__(
        self,
        boxes: Floats,
        places: Floats,
        axes: Floats,
        elevations: Floats,
        columns: int,
        far_m: float,
    ) -> None:
        local = boxes[:, None, :3] + _CORNERS * boxes[:, None, 3:]
        turn = axes.reshape(-1, 3, 3).transpose(0, 2, 1)
        corners = local @ turn + places[:, None]
        self._corners = np.ascontiguousarray(corners.transpose(2, 1, 0))
        self._elevations, self._columns, self._far_m = elevations, columns, far_m
        rays = np.arange(len(elevations) * columns).reshape(-1, columns)
        self._around = np.concatenate([rays, rays], axis=1).ravel()  # rows go around twice

    def candidates(self, position_xyz: Floats, R: Floats) -> tuple[Indices, Indices]:
        """Which rays can hit which geoms, from a lidar at a position, R being R_map_lidar.

        Returns:
            (G,) how many rays can hit each geom; (N,) the numbers of these rays, counted row by
            row, those of one geom side by side.
        """
        columns = self._columns
        around = self._corners - position_xyz[:, None, None]
        corners = (R.T @ around.reshape(3, -1)).reshape(around.shape)
        near, left, right, low, high = _extent(corners)
        per_rad = columns / (2 * np.pi)
        first = np.ceil((left - _SLACK_RAD + np.pi) * per_rad).astype(np.intp)
        last = np.floor((right + _SLACK_RAD + np.pi) * per_rad).astype(np.intp)
        width = np.minimum(last - first + 1, columns)
        bottom = np.searchsorted(self._elevations, low - _SLACK_RAD)
        top = np.searchsorted(self._elevations, high + _SLACK_RAD)
        height = np.where(near < self._far_m, top - bottom, 0)
        geoms = np.repeat(np.arange(len(height)), height)
        row = _runs(bottom, height)
        start = 2 * columns * row + (first % columns)[geoms]
        return height * width, self._around.take(_runs(start, width[geoms]), mode="clip")


def _runs(starts: Indices, lengths: Indices) -> Indices:
    """Runs of consecutive numbers, one after another: where each starts, and its length."""
    before = np.cumsum(lengths) - lengths
    runs: Indices = np.arange(lengths.sum()) + np.repeat(starts - before, lengths)
    return runs


def _extent(corners: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Shortest range, azimuth from and to, elevation from and to, (N,), of corners (3, 8, N)."""
    x, y, z = corners
    ahead, left = (x[0] + x[7]) / 2, (y[0] + y[7]) / 2
    aside = np.sqrt(((x - ahead) ** 2 + (y - left) ** 2).max(axis=0))
    away = np.hypot(ahead, left)
    level_near, level_far = np.maximum(away - aside, 1e-6), away + aside
    below, above = z.min(axis=0), z.max(axis=0)
    low = np.arctan2(below, np.where(below < 0, level_near, level_far))
    high = np.arctan2(above, np.where(above > 0, level_near, level_far))
    heading = np.arctan2(left, ahead)
    bearing = np.arctan2(ahead * y - left * x, ahead * x + left * y)  # from the heading
    around = away <= aside
    first = heading + np.where(around, -np.pi, bearing.min(axis=0))
    last = heading + np.where(around, np.pi, bearing.max(axis=0))
    height = np.maximum(np.maximum(below, -above), 0)
    return np.hypot(np.where(around, 0, level_near), height), first, last, low, high
