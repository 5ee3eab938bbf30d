"""Where rays meet boxes, cylinders and ellipsoids: as MuJoCo's own rays do, thousands at a time.

``mj_multiRay`` looks at every geom of a model for every ray. Here each ray is tried against those
few things alone that it can meet.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

Indices = npt.NDArray[np.intp]

PLANE = 0  # mjtGeom
_SPHERE, _ELLIPSOID, _CYLINDER, _BOX = 2, 4, 5, 6
_ROUND = {_SPHERE: 3, _ELLIPSOID: 3, _CYLINDER: 2, _BOX: 0}
"""Axes, the first ones, along which a thing is round; along the others it is flat."""
_SIZES = {_SPHERE: [0, 0, 0], _ELLIPSOID: [0, 1, 2], _CYLINDER: [0, 0, 1], _BOX: [0, 1, 2]}
"""Which of a geom's sizes is its half extent along x, y and z."""

_TINY = 1e-300  # for rays along a cylinder, which never cross its round side
_ASIDE = 1e-150  # for rays along a slab, which hardly ever cross its sides


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
        self._round = (np.arange(3)[:, None] < rounds).astype(np.float64)
        starts = [0, *(np.flatnonzero(np.diff(rounds)) + 1).tolist()]
        ends = [*starts[1:], len(rounds)]
        self._kinds = [(n, end, int(rounds[n])) for n, end in zip(starts, ends, strict=True) if end]

    def meet(self, position_xyz: Floats, R: Floats, rays: Floats, things: Indices) -> Floats:
        """Ranges in metres at which rays from one place meet each its thing, (N,), or infinity.

        From within a thing it is met where the ray leaves it.

        Args:
            position_xyz: (3,) where all start, in the world.
            R: the axes that the rays are in, R_map_rays.
            rays: (3, N) of length 1.
            things: (N,) places in the list, in rising order.
        """
        origins = (self._scale * (position_xyz[:, None] - self._places)).sum(axis=1)
        outside = (self._round * origins**2).sum(axis=0) - 1
        turns = (R.T @ self._scale).reshape(9, -1)
        table = np.concatenate([turns, origins, outside[None]])
        counts = np.bincount(things, minlength=table.shape[1])
        found = np.empty(len(things))
        begin = 0
        for first, last, rounded in self._kinds:
            each = np.repeat(table[:, first:last], counts[first:last], axis=1)
            end = begin + each.shape[1]
            x, y, z = rays[:, begin:end]
            directions = each[0:9:3] * x
            directions += each[1:9:3] * y
            directions += each[2:9:3] * z
            found[begin:end] = _enter(each[9:12], each[12], directions, rounded)
            begin = end
        return found


def _enter(origins: Floats, outside: Floats, directions: Floats, rounded: int) -> Floats:
    """Ranges at which rays (3, N) enter what is round along its first axes, flat along others.

    ``outside`` (N,) is the square of how far out of the round axes they start, less 1.
    """
    crossed = [_cross_ball(origins[:rounded], outside, directions[:rounded])] if rounded else []
    crossed += map(_cross_slab, origins[rounded:], directions[rounded:])
    near, far = crossed[0]
    for first, last in crossed[1:]:
        np.maximum(near, first, out=near)
        np.minimum(far, last, out=far)
    met = near <= far
    met &= far >= 0
    return np.where(met, np.where(near >= 0, near, far), np.inf)


def _cross_slab(origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
    """From and to which range rays (N,) are between -1 and 1."""
    half = 1 / (direction + _ASIDE)
    middle = origin * half
    np.abs(half, out=half)
    far = half - middle
    half += middle
    return np.negative(half, out=half), far


def _cross_ball(origins: Floats, outside: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """From and to which range rays are in the ball of radius 1; not a number where never."""
    a = _dot(directions, directions)
    np.maximum(a, _TINY, out=a)
    b = _dot(origins, directions)
    root = b * b
    root -= a * outside
    with np.errstate(invalid="ignore"):
        np.sqrt(root, out=root)
    near = root + b
    np.negative(near, out=near)
    near /= a
    root -= b
    root /= a
    return near, root


def _dot(a: Floats, b: Floats) -> Floats:
    """Of columns; for as few rows as here, faster than einsum."""
    products: Floats = a[0] * b[0]
    for i in range(1, len(a)):
        products += a[i] * b[i]
    return products
