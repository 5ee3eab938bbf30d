"""A lidar whose rays MuJoCo casts."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, PointCloud
from ros_visualise.simulation.engine import load_mujoco
from ros_visualise.simulation.sensors.noise import random_of
from ros_visualise.simulation.sensors.silhouettes import Silhouettes
from ros_visualise.simulation.settings import RobotParams

POINT = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2")]
)
_WORLD_ALONE = np.array([1, 0, 0, 0, 0, 0], np.uint8)  # group 0: the robot does not see itself


class Lidar:
    """Rows of rays all around, all at once, with white noise on the ranges.

    Only rays that can meet a thing are cast; where a ray meets the ground is known without.
    ``intensity`` is how bright the surface is, 0 to 100; ``ring`` 0 is the lowest row.
    """

    frame_id = "lidar_link"

    def __init__(self, params: RobotParams, seed: int, model: Any) -> None:
        self._params, self._seed, self._model = params, seed, model
        self._mujoco = load_mujoco()
        rings, columns = params.lidar_rings, params.lidar_columns
        elevation = np.radians(np.linspace(params.lidar_low, params.lidar_high, rings))
        azimuth = -np.pi + 2 * np.pi * np.arange(columns) / columns
        level = np.cos(elevation)[:, None]
        ray = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)[:, None]
        self._rays = np.stack(np.broadcast_arrays(*ray), axis=-1).reshape(-1, 3)
        self._rays32 = self._rays.astype(np.float32)
        self._rings = np.repeat(np.arange(rings, dtype=np.uint16), columns)
        self._silhouettes = Silhouettes(model, elevation, columns, params.lidar_far)
        self._brightness = _brightness(model)
        self._ground = self._mujoco.mj_name2id(model, self._mujoco.mjtObj.mjOBJ_GEOM, "ground")

    def measure(
        self, stamp_ns: int, index: int, data: Any, position_xyz: Floats, R: Floats
    ) -> PointCloud:
        """The scan of that number from a place in the world, R being R_map_lidar."""
        ranges, surface = self.cast(data, position_xyz, R)
        p = self._params
        met = np.flatnonzero((ranges >= p.lidar_near) & (ranges <= p.lidar_far))
        random = random_of(self._seed, "lidar", index)
        noise = random.standard_normal(len(met), np.float32)
        measured = ranges[met].astype(np.float32) + np.float32(p.lidar_noise) * noise
        points = np.empty(len(met), POINT)
        xyz = self._rays32[met] * measured[:, None]
        points["x"], points["y"], points["z"] = xyz[:, 0], xyz[:, 1], xyz[:, 2]
        points["intensity"] = self._brightness[surface[met]]
        points["ring"] = self._rings[met]
        return PointCloud(points, True, Header(stamp_ns, self.frame_id))

    def cast(
        self, data: Any, position_xyz: Floats, R: Floats
    ) -> tuple[Floats, npt.NDArray[np.int32]]:
        """True ranges (N,) in metres, infinite where nothing is, and the geom that each ray met."""
        down = self._rays @ R[2]
        with np.errstate(divide="ignore"):
            ranges = np.where(down < 0, -position_xyz[2] / down, np.inf)
        surface = np.full(len(ranges), self._ground, np.int32)
        rays = np.flatnonzero(self._silhouettes.cover(position_xyz, R, ranges))
        if len(rays):
            found, geoms = self._cast(data, position_xyz, self._rays[rays] @ R.T)
            nearer = (found >= 0) & (found < ranges[rays])
            ranges[rays[nearer]] = found[nearer]
            surface[rays[nearer]] = geoms[nearer]
        return ranges, surface

    def _cast(
        self, data: Any, position_xyz: Floats, rays: Floats
    ) -> tuple[Floats, npt.NDArray[np.int32]]:
        count = len(rays)
        geoms, ranges = np.empty(count, np.int32), np.empty(count)
        self._mujoco.mj_multiRay(
            self._model,
            data,
            position_xyz,
            rays.ravel(),
            _WORLD_ALONE,
            1,
            -1,
            geoms,
            ranges,
            None,
            count,
            self._params.lidar_far,
        )
        return ranges, geoms


def _brightness(model: Any) -> npt.NDArray[np.float32]:
    """Of each geom, 0 to 100, by its colour."""
    colours = np.array(model.geom_rgba[:, :3], np.float32)
    painted = model.geom_matid >= 0
    colours[painted] = np.minimum(model.mat_rgba[model.geom_matid[painted], :3], 0.6)
    return np.asarray(100 * colours.mean(axis=1), np.float32)
