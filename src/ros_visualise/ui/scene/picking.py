"""Points that a person clicks in the scene."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats

_CLOSE = np.tan(np.radians(0.7))  # how far a finger or a mouse may be off
_LEVEL = 1e-6


class Ray(NamedTuple):
    """From a camera through a pixel, in the fixed frame: ``origin`` (3,), ``direction`` (3,)."""

    origin: Floats
    direction: Floats


def pick(ray: Ray, points_xyz: npt.NDArray[np.floating], ground_m: float = 0.0) -> Floats | None:
    """The nearest point at a ray, or where it meets the ground, whichever is nearer.

    Args:
        ray: where a person clicked.
        points_xyz: (N, 3) metres in the fixed frame, of all that is drawn.
        ground_m: the height of the ground in it.

    Returns:
        (3,) metres in the fixed frame; None for the sky.
    """
    direction = ray.direction / np.linalg.norm(ray.direction)
    found = _nearest(ray.origin, direction, points_xyz)
    ground = _on_ground(ray.origin, direction, ground_m)
    if found is None or ground is None:
        return ground if found is None else found
    away: list[Any] = [np.linalg.norm(one - ray.origin) for one in (found, ground)]
    return found if away[0] <= away[1] * (1 + _CLOSE) else ground


def _nearest(
    origin: Floats, direction: Floats, points_xyz: npt.NDArray[np.floating]
) -> Floats | None:
    """The point close to the ray that hides the others."""
    ways = points_xyz - origin
    along = ways @ direction
    aside = np.linalg.norm(ways - along[:, None] * direction, axis=1)
    close = np.flatnonzero((along > 0) & (aside <= _CLOSE * along))
    if not len(close):
        return None
    front = close[along[close] <= along[close].min() * (1 + 2 * _CLOSE)]
    best = front[np.argmin(aside[front] / along[front])]
    return np.asarray(points_xyz[best], np.float64)


def _on_ground(origin: Floats, direction: Floats, ground_m: float) -> Floats | None:
    if abs(direction[2]) < _LEVEL:
        return None
    along = (ground_m - origin[2]) / direction[2]
    return origin + along * direction if along > 0 else None
