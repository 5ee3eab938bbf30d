"""A lidar among the geoms of a MuJoCo world."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, PointCloud
from ros_visualise.simulation.sensors.noise import random_of
from ros_visualise.simulation.sensors.rays import PLANE, Ranges, Things
from ros_visualise.simulation.sensors.silhouettes import Silhouettes
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
_GROUND = -1
_NOISE_BITS = 16  # at least, of how many numbers scans take turns with
_NOISE_STEP = 40503  # from scan to scan: odd, so that a ray goes through all of them


class Lidar:
    """Rows of rays all around, all at once, with white noise on the ranges.

    The robot does not see itself. The ground is the plane z = 0. ``intensity`` is how bright the
    surface is, 0 to 100; ``ring`` 0 is the lowest row.

    The noise is of one long list of numbers, from elsewhere in it at each scan: drawing them anew
    would take a tenth of a scan's time.
    """

    frame_id = "lidar_link"

    def __init__(self, params: RobotParams, seed: int, model: Any, data: Any) -> None:
        self._params = params
        rings, columns = params.lidar_rings, params.lidar_columns
        elevation = np.radians(np.linspace(params.lidar_low, params.lidar_high, rings))
        azimuth = -np.pi + 2 * np.pi * np.arange(columns) / columns
        level = np.cos(elevation)[:, None]
        ray = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)[:, None]
        self._rays = np.stack(np.broadcast_arrays(*ray)).reshape(3, -1).astype(np.float32)
        rays = rings * columns
        self._period = 1 << max(_NOISE_BITS, rays.bit_length())  # no number twice in a scan
        noise = random_of(seed, "lidar").standard_normal(self._period, np.float32)
        noise *= np.float32(params.lidar_noise)
        self._noise = np.resize(noise, self._period + rays)
        self._points = np.zeros((rays, 5), np.float32)  # at a range of one metre
        self._points[:, :3] = self._rays.T
        self._points.view(POINT)["ring"][:, 0] = np.repeat(np.arange(rings), columns)
        standing = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type != PLANE))
        things = standing[np.argsort(model.geom_type[standing], kind="stable")]
        boxes, places, axes = (
            model.geom_aabb[things],
            data.geom_xpos[things],
            data.geom_xmat[things],
        )
        far = params.lidar_far
        self._silhouettes = Silhouettes(boxes, places, axes, elevation, columns, far)
        self._things = Things(model, data, things)
        ground = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type == PLANE))
        self._brightness = _brightness(model, np.append(things, ground[0]))

    def measure(self, stamp_ns: int, index: int, position_xyz: Floats, R: Floats) -> PointCloud:
        """The scan of that number from a place in the world, R being R_map_lidar."""
        ranges, surface = self.cast(position_xyz, R)
        p = self._params
        met = np.flatnonzero((ranges >= p.lidar_near) & (ranges <= p.lidar_far))
        start = index * _NOISE_STEP % self._period
        noise = self._noise[start : start + len(ranges)]  # of each ray its own, whatever others met
        measured = noise.take(met) + ranges.take(met)
        points = self._points.take(met, axis=0, mode="clip")
        for axis in range(3):
            points[:, axis] *= measured
        points[:, 3] = self._brightness.take(surface.take(met))
        return PointCloud(points.view(POINT)[:, 0], True, Header(stamp_ns, self.frame_id))

    def cast(self, position_xyz: Floats, R: Floats) -> tuple[Ranges, Indices]:
        """True ranges (N,) in metres, infinite where nothing is, and what each ray met.

        That is the place of a thing among those that stand in the world, -1 for the ground.
        """
        sinking = abs(np.maximum(-R[2].astype(np.float32) @ self._rays, 0))
        with np.errstate(divide="ignore"):
            ranges = np.float32(position_xyz[2]) / sinking
        surface = np.full(len(ranges), _GROUND, np.intp)
        counts, rays = self._silhouettes.pairs(position_xyz, R)
        tried = self._rays.take(rays, axis=1, mode="clip")  # looking for wrong ones takes longer
        found, met = self._things.meet(position_xyz, R, tried, counts)
        met &= found < ranges.take(rays)
        nearer = np.flatnonzero(met)
        things = np.repeat(np.arange(len(counts)), counts)
        found, rays, things = found.take(nearer), rays.take(nearer), things.take(nearer)
        while len(rays):  # where things are one behind another, any may be written first
            ranges[rays], surface[rays] = found, things
            left = np.flatnonzero(found < ranges.take(rays))
            found, rays, things = found.take(left), rays.take(left), things.take(left)
        return ranges, surface


def _brightness(model: Any, geoms: Indices) -> npt.NDArray[np.float32]:
    """Of each, 0 to 100, by its colour; painted ones are of a middle one."""
    colours = np.array(model.geom_rgba[geoms, :3], np.float32).mean(axis=1)
    return np.asarray(100 * np.where(model.geom_matid[geoms] >= 0, 0.5, colours), np.float32)
