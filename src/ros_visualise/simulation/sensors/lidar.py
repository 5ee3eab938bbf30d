"""A lidar among the geoms of a MuJoCo world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Header, PointCloud
from ros_visualise.simulation.delivery import delivered
from ros_visualise.simulation.noise import random_of
from ros_visualise.simulation.rays import PLANE, Ranges, RayCulling, StaticGeoms
from ros_visualise.simulation.sensors import Fitting, Measure, SensorType, setting

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
_NOISE_BITS = 16  # at least 2**16 numbers of noise
_NOISE_STEP = 40503  # from scan to scan: odd, so that a ray uses every number in turn

_lidar = partial(setting, group="lidar")


@delivered("lidar", "lidar")
@dataclass(frozen=True)
class LidarParams:
    """Parameters of a lidar."""

    lidar: bool = _lidar(True, "switch the lidar on")
    lidar_rate: float = _lidar(10.0, "scans per second", min=0.1, max=50)
    lidar_rings: int = _lidar(16, "number of rows of rays, stacked vertically", min=1, max=128)
    lidar_columns: int = _lidar(900, "number of rays per row, over 360 degrees", min=1, max=4096)
    lidar_low: float = _lidar(-15.0, "elevation of the lowest row, degrees", min=-89, max=89)
    lidar_high: float = _lidar(15.0, "elevation of the highest row, degrees", min=-89, max=89)
    lidar_near: float = _lidar(0.5, "shortest range, m", min=0, max=10)
    lidar_far: float = _lidar(100.0, "longest range, m", min=1, max=1000)
    lidar_noise: float = _lidar(0.02, "noise of each range (standard deviation), m", min=0, max=1)


class Lidar:
    """A 360 degree lidar whose rays all measure at once, with white noise on the ranges.

    It does not see its own robot. The ground is the plane z = 0. ``intensity`` is the brightness of
    the surface, 0 to 100; ``ring`` 0 is the lowest row.

    The noise is drawn once, and each scan uses another part of it: new numbers for each scan would
    take a tenth of its time.
    """

    frame_id = "lidar_link"

    def __init__(self, params: LidarParams, seed: int, model: Any, data: Any) -> None:
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
        geoms = standing[np.argsort(model.geom_type[standing], kind="stable")]
        boxes, places, axes = (model.geom_aabb[geoms], data.geom_xpos[geoms], data.geom_xmat[geoms])
        far = params.lidar_far
        self._culling = RayCulling(boxes, places, axes, elevation, columns, far)
        self._geoms = StaticGeoms(model, data, geoms)
        ground = np.flatnonzero((model.geom_bodyid == 0) & (model.geom_type == PLANE))
        self._brightness = _brightness(model, np.append(geoms, ground[0]))

    def measure(self, stamp_ns: int, index: int, position_xyz: Floats, R: Floats) -> PointCloud:
        """The scan with that index from a lidar at a position with R_map_lidar."""
        ranges, surface = self.cast(position_xyz, R)
        p = self._params
        met = np.flatnonzero((ranges >= p.lidar_near) & (ranges <= p.lidar_far))
        start = index * _NOISE_STEP % self._period
        noise = self._noise[start : start + len(ranges)]  # per ray, whatever others hit
        measured = noise.take(met) + ranges.take(met)
        points = self._points.take(met, axis=0, mode="clip")
        for axis in range(3):
            points[:, axis] *= measured
        points[:, 3] = self._brightness.take(surface.take(met))
        return PointCloud(points.view(POINT)[:, 0], True, Header(stamp_ns, self.frame_id))

    def cast(self, position_xyz: Floats, R: Floats) -> tuple[Ranges, Indices]:
        """True ranges (N,) in metres, infinite without a hit, and the object hit by each ray.

        Objects are indices of static geoms, -1 for the ground.
        """
        sinking = abs(np.maximum(-R[2].astype(np.float32) @ self._rays, 0))
        with np.errstate(divide="ignore"):
            ranges = np.float32(position_xyz[2]) / sinking
        surface = np.full(len(ranges), _GROUND, np.intp)
        counts, rays = self._culling.candidates(position_xyz, R)
        tested = self._rays.take(rays, axis=1, mode="clip")  # "raise" takes longer
        found, hit = self._geoms.intersect(position_xyz, R, tested, counts)
        hit &= found < ranges.take(rays)
        nearer = np.flatnonzero(hit)
        geoms = np.repeat(np.arange(len(counts)), counts)
        found, rays, geoms = found.take(nearer), rays.take(nearer), geoms.take(nearer)
        while len(rays):  # overlapping geoms may be written in any order
            ranges[rays], surface[rays] = found, geoms
            left = np.flatnonzero(found < ranges.take(rays))
            found, rays, geoms = found.take(left), rays.take(left), geoms.take(left)
        return ranges, surface


def _brightness(model: Any, geoms: Indices) -> npt.NDArray[np.float32]:
    """0 to 100 for each geom by its colour; 50 if textured."""
    colours = np.array(model.geom_rgba[geoms, :3], np.float32).mean(axis=1)
    return np.asarray(100 * np.where(model.geom_matid[geoms] >= 0, 0.5, colours), np.float32)


def fit(fitting: Fitting) -> Measure:
    """The lidar on the robot."""
    body = fitting.robot.body
    lidar = Lidar(fitting.settings, fitting.seed, fitting.model, fitting.data)
    return lambda stamp_ns, index: {
        "points": lidar.measure(stamp_ns, index, *body.site("lidar_link"))
    }


SENSOR = SensorType(
    LidarParams, {"points": PointCloud}, "lidar_rate", fit, "lidar", delivery="lidar"
)
