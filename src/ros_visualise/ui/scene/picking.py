"""Points that a person clicks in the scene, and the pins that mark them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import Floats
from ros_visualise.ui.scene.drawing import node_name

_CLOSE = np.tan(np.radians(0.7))  # how far a finger or a mouse may be off
_LEVEL = 1e-6
_COLOR = (255, 255, 255)
_RADIUS = 0.06
_TEXT = 0.9
_WIDTH_PX = 2.0


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


class Pins:
    """One or two places in the fixed frame."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._nodes: list[viser.SceneNodeHandle] = []

    def show(self, places_xyz: list[Floats], text: str, size_m: float) -> None:
        """Replace the pins: places (3,), a line between them, and a text."""
        self.clear()
        for number, place in enumerate(places_xyz):
            ball = self._scene.add_icosphere(
                node_name("pins", str(number)), _RADIUS * size_m, _COLOR, position=place
            )
            self._nodes.append(ball)
        if len(places_xyz) > 1:
            line = np.array(places_xyz, np.float32)[None]
            self._nodes.append(
                self._scene.add_line_segments(
                    node_name("pins", "line"),
                    line,
                    _COLOR,
                    thickness=_WIDTH_PX,
                    thickness_units="screen",
                )
            )
        if places_xyz:
            self._nodes.append(
                self._scene.add_label(
                    node_name("pins", "text"),
                    text,
                    position=np.mean(places_xyz, axis=0),
                    font_screen_scale=_TEXT,
                    anchor="bottom-center",
                )
            )

    def clear(self) -> None:
        for node in self._nodes:
            node.remove()
        self._nodes = []
