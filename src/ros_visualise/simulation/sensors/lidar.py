"""A lidar whose rays MuJoCo casts."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, PointCloud
from ros_visualise.simulation.sensors.noise import random_of
from ros_visualise.simulation.sensors.rays import RayCaster
from ros_visualise.simulation.sensors.silhouettes import Cover, Silhouettes
from ros_visualise.simulation.settings import RobotParams

Indices = npt.NDArray[np.intp]

POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2"],
        "offsets": [0, 4, 8, 12, 16],
        "itemsize": 20,
    }
)
_SECTORS = 15
_PLANE = 0  # mjGEOM_PLANE
_GROUND = -1


class Lidar:
    """Rows of rays all around, all at once, with white noise on the ranges.

    The robot does not see itself. Only rays that can meet a thing are cast: where a ray meets the
    ground, the plane z = 0, is known without. ``intensity`` is how bright the surface is, 0 to 100;
    ``ring`` 0 is the lowest row.
    """

    frame_id = "lidar_link"

    def __init__(self, params: RobotParams, seed: int, model: Any, data: Any) -> None:
        self._params, self._seed = params, seed
        rings, columns = params.lidar_rings, params.lidar_columns
        elevation = np.radians(np.linspace(params.lidar_low, params.lidar_high, rings))
        azimuth = -np.pi + 2 * np.pi * np.arange(columns) / columns
        level = np.cos(elevation)[:, None]
        ray = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)[:, None]
        self._rays = np.stack(np.broadcast_arrays(*ray), axis=-1).reshape(-1, 3)
        self._rays32 = self._rays.astype(np.float32)
        self._rings = np.repeat(np.arange(rings, dtype=np.uint16), columns)
        still = (model.geom_bodyid == 0) & (model.geom_type != _PLANE)
        things = np.flatnonzero(still)
        boxes, places, axes = (
            model.geom_aabb[things],
            data.geom_xpos[things],
            data.geom_xmat[things],
        )
        far = params.lidar_far
        self._silhouettes = Silhouettes(boxes, places, axes, elevation, columns, far)
        self._caster = RayCaster(model, data, things)
        ground = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type == _PLANE))
        self._brightness = _brightness(model, np.append(things, ground[0]))
        self._cuts = np.linspace(0, columns, _SECTORS + 1).astype(np.intp)

    def measure(self, stamp_ns: int, index: int, position_xyz: Floats, R: Floats) -> PointCloud:
        """The scan of that number from a place in the world, R being R_map_lidar."""
        ranges, surface = self.cast(position_xyz, R)
        p = self._params
        met = np.flatnonzero((ranges >= p.lidar_near) & (ranges <= p.lidar_far))
        random = random_of(self._seed, "lidar", index)
        measured = random.standard_normal(len(met), np.float32)
        measured *= np.float32(p.lidar_noise)
        measured += ranges[met]
        points = np.empty((len(met), 5), np.float32)
        np.multiply(self._rays32.take(met, axis=0), measured[:, None], out=points[:, :3])
        points[:, 3] = self._brightness[surface[met]]
        points[:, 4] = 0  # what pads the rings out
        cloud = points.view(POINT)[:, 0]
        cloud["ring"] = self._rings[met]
        return PointCloud(cloud, True, Header(stamp_ns, self.frame_id))

    def cast(self, position_xyz: Floats, R: Floats) -> tuple[Floats, Indices]:
        """True ranges (N,) in metres, infinite where nothing is, and what each ray met.

        That is the place of a thing among those that stand in the world, -1 for the ground.
        """
        down = self._rays @ R[2]
        ranges = np.full(len(down), np.inf)
        np.divide(-position_xyz[2], down, out=ranges, where=down < 0)
        surface = np.full(len(ranges), _GROUND, np.intp)
        cover = self._silhouettes.cover(position_xyz, R)
        shape = cover.near_m.shape
        columns, rows = np.nonzero((cover.near_m < ranges.reshape(shape)).T)
        rays = rows * shape[1] + columns
        found, things = self._cast(
            position_xyz, self._rays.take(rays, axis=0) @ R.T, columns, cover
        )
        nearer = np.flatnonzero((things >= 0) & (found < ranges[rays]))
        ranges[rays[nearer]] = found[nearer]
        surface[rays[nearer]] = things[nearer]
        return ranges, surface

    def _cast(
        self, position_xyz: Floats, rays: Floats, columns: Indices, cover: Cover
    ) -> tuple[Floats, Indices]:
        """Ranges and things met, (N,) each, -1 for none: sector by sector of the rays' columns."""
        found, things = np.full(len(rays), -1.0), np.full(len(rays), -1)
        starts = np.searchsorted(columns, self._cuts).tolist()
        for sector, among in enumerate(self._among(cover)):
            part = slice(starts[sector], starts[sector + 1])
            if len(among) and part.stop > part.start:
                found[part], things[part] = self._caster.cast(
                    position_xyz, rays[part], among, self._params.lidar_far
                )
        return found, things

    def _among(self, cover: Cover) -> list[Indices]:
        """The things that reach into each sector."""
        columns = int(self._cuts[-1])
        turns = np.array([-columns, 0, columns])[:, None, None]
        begins, ends = self._cuts[:-1, None] + turns, self._cuts[1:, None] + turns
        reach = ((cover.first < ends) & (cover.last > begins)).any(axis=0)
        return [cover.things[each] for each in reach]


def _brightness(model: Any, geoms: Indices) -> npt.NDArray[np.float32]:
    """Of each, 0 to 100, by its colour; painted ones are of a middle one."""
    colours = np.array(model.geom_rgba[geoms, :3], np.float32).mean(axis=1)
    return np.asarray(100 * np.where(model.geom_matid[geoms] >= 0, 0.5, colours), np.float32)
