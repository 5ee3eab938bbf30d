"""Where rays hit boxes, cylinders and ellipsoids, thousands of rays at a time.

MuJoCo's own ``mj_multiRay`` tests every ray against every geom, and takes 8 to 100 times as long
(`benchmarks/lidar.py`). Here each ray is tested only against the few geoms that it can hit, in
float32, as ranges are published; the results agree to a tenth of a millimetre.
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
"""How many axes, from the first on, a geom is round along; along the others it is flat."""
_SIZES = {_SPHERE: [0, 0, 0], _ELLIPSOID: [0, 1, 2], _CYLINDER: [0, 0, 1], _BOX: [0, 1, 2]}
"""Which of a geom's sizes is its half extent along x, y and z."""

_TINY = np.float32(1e-30)  # for rays parallel to a cylinder, which never hit its round side
_ASIDE = np.float32(1e-30)  # for rays parallel to a slab, which hardly ever hit its sides


class StaticGeoms:
    """Geoms that do not move, for rays to hit.

    Scaled to half extents of one, each is the intersection of a ball over its round axes and of
    slabs from -1 to 1 along its flat axes. So the part of a ray inside it is an intersection too.

    Args:
        model, data: the whole world, its positions up to date.
        geoms: (G,) numbers of the geoms, those of one type side by side.

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
        """Ranges in metres at which rays hit the geom that each is tested against, and whether.

        A ray that starts inside a geom hits it where it leaves it.

        Args:
            position_xyz: (3,) where all rays start, in the world.
            R: R_map_rays.
            rays: (3, N) unit vectors, those tested against one geom side by side.
            counts: (G,) how many rays are tested against each geom.
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
    """The ranges from and to which rays (3, N) are inside a shape with so many round axes.

    Of a ray that misses it, the two are in the wrong order or not numbers.
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
    """The ranges from and to which rays are inside the ball of radius 1; not numbers if never."""
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
