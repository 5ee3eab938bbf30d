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
        self._scale = (axes / halves.reshape(-1, 1, 3)).transpose(0, 2, 1)
        self._places = np.array(data.geom_xpos[geoms])
        rounds = np.array([_ROUND[t] for t in types])
        starts = [0, *(np.flatnonzero(np.diff(rounds)) + 1).tolist()]
        self._kinds = [(n, int(rounds[n])) for n in starts if n < len(rounds)]

    def meet(self, position_xyz: Floats, R: Floats, rays: Floats, things: Indices) -> Floats:
        """Ranges in metres at which rays from one place meet each its thing, (N,), or infinity.

        From within a thing it is met where the ray leaves it.

        Args:
            position_xyz: (3,) where all start, in the world.
            R: the axes that the rays are in, R_map_rays.
            rays: (3, N) of length 1.
            things: (N,) places in the list, in rising order.
        """
        origins = np.einsum("gij,gj->ig", self._scale, position_xyz - self._places)
        turns = np.moveaxis(self._scale @ R, 0, -1).reshape(9, -1)
        found = np.empty(len(things))
        ends = np.searchsorted(things, [start for start, _ in self._kinds] + [len(self._places)])
        for (_, rounded), begin, end in zip(self._kinds, ends[:-1], ends[1:], strict=True):
            part = things[begin:end]
            turn = turns.take(part, axis=1).reshape(3, 3, -1)
            directions = np.einsum("ijn,jn->in", turn, rays[:, begin:end])
            found[begin:end] = _enter(origins.take(part, axis=1), directions, rounded)
        return found


def _enter(origins: Floats, directions: Floats, rounded: int) -> Floats:
    """Ranges at which rays (3, N) enter what is round along its first axes, flat along others."""
    near, far = np.full(origins.shape[1], -np.inf), np.full(origins.shape[1], np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        if rounded:
            near, far = _cross_ball(origins[:rounded], directions[:rounded])
        for origin, direction in zip(origins[rounded:], directions[rounded:], strict=True):
            first, second = (-1 - origin) / direction, (1 - origin) / direction
            near = np.maximum(near, np.minimum(first, second))
            far = np.minimum(far, np.maximum(first, second))
        return np.where((near <= far) & (far >= 0), np.where(near >= 0, near, far), np.inf)


def _cross_ball(origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """From and to which range rays are in the ball of radius 1; not a number where never."""
    a = np.maximum(np.einsum("in,in->n", directions, directions), _TINY)
    b = np.einsum("in,in->n", origins, directions)
    c = np.einsum("in,in->n", origins, origins) - 1
    root = np.sqrt(b * b - a * c)
    return (-b - root) / a, (-b + root) / a
