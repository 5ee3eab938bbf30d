"""Intersection of thousands of rays at a time with boxes, cylinders and ellipsoids.

MuJoCo's own ``mj_multiRay`` tests every ray against every geom, and takes 8 to 100 times as long
(`benchmarks/lidar.py`). Here each ray is tested only against the few geoms that it can hit, in
float32, like the published ranges; the results agree to a tenth of a millimetre.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]
Ranges = npt.NDArray[np.float32]
Hits = npt.NDArray[np.bool_]

PLANE = 0  # mjtGeom
_SPHERE, _ELLIPSOID, _CYLINDER, _BOX = 2, 4, 5, 6
_ROUND = {_SPHERE: 3, _ELLIPSOID: 3, _CYLINDER: 2, _BOX: 0}
"""Number of round axes of a geom, from the first on; it is flat along the others."""
_SIZES = {_SPHERE: [0, 0, 0], _ELLIPSOID: [0, 1, 2], _CYLINDER: [0, 0, 1], _BOX: [0, 1, 2]}
"""Indices of the sizes that are the half extents along x, y and z."""

_TINY = np.float32(1e-30)  # for rays parallel to a cylinder, which never hit its round side
_ASIDE = np.float32(1e-30)  # for rays parallel to a slab, which rarely hit its sides
_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
_SLACK_RAD = 1e-4


class StaticGeoms:
    """Static geoms to intersect with rays.

    Scaled to half extents of one, each is the intersection of a ball over its round axes and of
    slabs from -1 to 1 along its flat axes. So the part of a ray inside it is an intersection too.

    Args:
        model, data: the whole world, with positions up to date.
        geoms: (G,) ids of the geoms, sorted by type.

    Raises:
        KeyError: a geom is neither a sphere, an ellipsoid, a cylinder nor a box.

    Source: Kay and Kajiya, Ray tracing complex scenes, 1986.
    """

    def __init__(self, model: Any, data: Any, geoms: Indices) -> None:
        types = model.geom_type[geoms].tolist()
        halves = np.array(
            [model.geom_size[g][_SIZES[t]] for g, t in zip(geoms, types, strict=True)]
        )
        axes = data.geom_xmat[geoms].reshape(-1, 3, 3)
        self._scale = np.ascontiguousarray((axes / halves.reshape(-1, 1, 3)).transpose(2, 1, 0))
        self._places = np.ascontiguousarray(data.geom_xpos[geoms].T)
        rounds = np.array([_ROUND[t] for t in types])
        starts = [0, *(np.flatnonzero(np.diff(rounds)) + 1).tolist()]
        ends = [*starts[1:], len(rounds)]
        self._kinds = [(n, end, int(rounds[n])) for n, end in zip(starts, ends, strict=True) if end]

    def intersect(
        self, position_xyz: Floats, R: Floats, rays: Ranges, counts: Indices
    ) -> tuple[Ranges, Hits]:
        """Ranges in metres at which rays hit the geom they are tested against, and a mask of hits.

        A ray that starts inside a geom hits it where it leaves it.

        Args:
            position_xyz: (3,) common start of the rays, in the world.
            R: R_map_rays.
            rays: (3, N) unit vectors, sorted by geom.
            counts: (G,) number of rays for each geom.
        """
        origins = (self._scale * (position_xyz[:, None] - self._places)).sum(axis=1)
        turns = (R.T @ self._scale).reshape(9, -1)
        table = np.concatenate([turns, origins], dtype=np.float32)
        ranges, hit = np.empty(rays.shape[1], np.float32), np.empty(rays.shape[1], np.bool_)
        begin = 0
        for first, last, rounded in self._kinds:
            each = np.repeat(table[:, first:last], counts[first:last], axis=1)
            end = begin + each.shape[1]
            turned = each[:9].reshape(3, 3, -1) * rays[:, begin:end]
            directions = turned[:, 0]
            directions += turned[:, 1]
            directions += turned[:, 2]
            near, far = _cross(each[9:], directions, rounded)
            np.logical_and(near <= far, far >= 0, out=hit[begin:end])
            within = near < 0
            ranges[begin:end] = np.where(within, far, near) if within.any() else near
            begin = end
        return ranges, hit


def _cross(origins: Ranges, directions: Ranges, rounded: int) -> tuple[Ranges, Ranges]:
    """The ranges from and to which rays (3, N) are inside a shape with ``rounded`` round axes.

    For a ray that misses it, they are in the wrong order or NaN.
    """
    crossed = [_cross_ball(origins[:rounded], directions[:rounded])] if rounded else []
    crossed += map(_cross_slab, origins[rounded:], directions[rounded:])
    near, far = crossed[0]
    for first, last in crossed[1:]:
        np.maximum(near, first, out=near)
        np.minimum(far, last, out=far)
    return near, far


def _cross_slab(origin: Ranges, direction: Ranges) -> tuple[Ranges, Ranges]:
    """The ranges from and to which rays (N,) are between -1 and 1."""
    half = 1 / (direction + _ASIDE)
    middle = origin * half
    np.abs(half, out=half)
    far = half - middle
    half += middle
    return np.negative(half, out=half), far


def _cross_ball(origins: Ranges, directions: Ranges) -> tuple[Ranges, Ranges]:
    """The ranges from and to which rays are inside the unit ball; NaN if never."""
    a = _dot(directions, directions)
    np.maximum(a, _TINY, out=a)
    middle = _dot(origins, directions)
    middle /= a
    nearest = directions * middle
    np.subtract(origins, nearest, out=nearest)
    root = _dot(nearest, nearest)
    np.subtract(1, root, out=root)
    root /= a
    with np.errstate(invalid="ignore"):
        np.sqrt(root, out=root)
    far = root - middle
    root += middle
    return np.negative(root, out=root), far


def _dot(a: Ranges, b: Ranges) -> Ranges:
    """Dot products of columns; with so few rows faster than einsum."""
    products: Ranges = a[0] * b[0]
    for i in range(1, len(a)):
        products += a[i] * b[i]
    return products


class RayCulling:
    """Finds the rays that can hit each geom's bounding box.

    It returns a few rays too many, never too few.

    Args:
        boxes: (G, 6) centre and half sides of each geom's bounding box in its own axes.
        places, axes: (G, 3) and (G, 9) position and rotation of each geom in the world.
        elevations: (rows,) of the rows of rays, rad, rising.
        columns: rays in a row, the first at azimuth -pi.
        far_m: largest range.
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
        """Candidate rays for each geom, from a lidar at a position with R_map_lidar.

        Returns:
            (G,) number of rays that can hit each geom; (N,) indices of these rays, row by row,
                sorted by geom.
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
    """Runs of consecutive numbers, one after another, from their starts and lengths."""
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
