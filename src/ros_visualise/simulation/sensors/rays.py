"""Where rays meet boxes, cylinders and ellipsoids: as MuJoCo's own rays do, thousands at a time.

``mj_multiRay`` looks at every geom of a model for every ray. Here each ray is tried against those
few things alone that it can meet, in numbers of 32 bits, as ranges are told in: within a tenth of a
millimetre of MuJoCo's.
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
"""Axes, the first ones, along which a thing is round; along the others it is flat."""
_SIZES = {_SPHERE: [0, 0, 0], _ELLIPSOID: [0, 1, 2], _CYLINDER: [0, 0, 1], _BOX: [0, 1, 2]}
"""Which of a geom's sizes is its half extent along x, y and z."""

_TINY = np.float32(1e-30)  # for rays along a cylinder, which never cross its round side
_ASIDE = np.float32(1e-30)  # for rays along a slab, which hardly ever cross its sides


class Things:
    """Geoms that do not move.

    Each is scaled to half extents of one. Then it is what a ball, over its round axes, and slabs
    from -1 to 1, along its flat ones, have in common; so is the part of a ray that is in it.

    Args:
        model, data: of the whole world, positions up to date.
        geoms: (G,) their numbers in it, those of one type side by side.

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

    def meet(
        self, position_xyz: Floats, R: Floats, rays: Ranges, counts: Indices
    ) -> tuple[Ranges, Hits]:
        """Ranges in metres at which rays from one place meet each its thing, and whether they do.

        From within a thing it is met where the ray leaves it.

        Args:
            position_xyz: (3,) where all start, in the world.
            R: the axes that the rays are in, R_map_rays.
            rays: (3, N) of length 1, those that are tried against one thing side by side.
            counts: (G,) how many are tried against each thing.
        """
        origins = (self._scale * (position_xyz[:, None] - self._places)).sum(axis=1)
        turns = (R.T @ self._scale).reshape(9, -1)
        table = np.concatenate([turns, origins], dtype=np.float32)
        ranges, met = np.empty(rays.shape[1], np.float32), np.empty(rays.shape[1], np.bool_)
        begin = 0
        for first, last, rounded in self._kinds:
            each = np.repeat(table[:, first:last], counts[first:last], axis=1)
            end = begin + each.shape[1]
            turned = each[:9].reshape(3, 3, -1) * rays[:, begin:end]
            directions = turned[:, 0]
            directions += turned[:, 1]
            directions += turned[:, 2]
            near, far = _cross(each[9:], directions, rounded)
            np.logical_and(near <= far, far >= 0, out=met[begin:end])
            within = near < 0
            ranges[begin:end] = np.where(within, far, near) if within.any() else near
            begin = end
        return ranges, met


def _cross(origins: Ranges, directions: Ranges, rounded: int) -> tuple[Ranges, Ranges]:
    """From and to which range rays (3, N) are in what is round along its first axes, else flat.

    Where a ray is never in it they are not in order, or no numbers.
    """
    crossed = [_cross_ball(origins[:rounded], directions[:rounded])] if rounded else []
    crossed += map(_cross_slab, origins[rounded:], directions[rounded:])
    near, far = crossed[0]
    for first, last in crossed[1:]:
        np.maximum(near, first, out=near)
        np.minimum(far, last, out=far)
    return near, far


def _cross_slab(origin: Ranges, direction: Ranges) -> tuple[Ranges, Ranges]:
    """From and to which range rays (N,) are between -1 and 1."""
    half = 1 / (direction + _ASIDE)
    middle = origin * half
    np.abs(half, out=half)
    far = half - middle
    half += middle
    return np.negative(half, out=half), far


def _cross_ball(origins: Ranges, directions: Ranges) -> tuple[Ranges, Ranges]:
    """From and to which range rays are in the ball of radius 1; not a number where never."""
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
    """Of columns; for as few rows as here, faster than einsum."""
    products: Ranges = a[0] * b[0]
    for i in range(1, len(a)):
        products += a[i] * b[i]
    return products
