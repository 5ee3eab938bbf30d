"""Lines: paths, trails and polygons."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Path, PolygonStamped
from ros_visualise.geometry.thinning import evenly
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Lines
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing

_MAX_VERTICES = 5000
_SPACING_M = 0.05
_FAR_M = 10_000.0
_NS = 1_000_000_000
_FAINT, _GRAY, _FAINT_WIDTH = 0.3, 140, 1.5
_MAX_SPEED_MPS = 400.0  # faster is a jump


class Line:
    """One line through points, changed in place; ``faint``: thin, and nearly gray."""

    def __init__(self, scene: SpaceTree, name: str, color: Color, faint: bool = False) -> None:
        if faint:
            red, green, blue = (round(_FAINT * one + (1 - _FAINT) * _GRAY) for one in color)
            color = red, green, blue
        lines = Lines(colors=color, width=_FAINT_WIDTH) if faint else Lines(colors=color)
        self._scene, self._lines = scene, scene.add(name, lines)

    def show(self, vertices: npt.NDArray[np.floating]) -> None:
        """Replace its points (N, 3); many are thinned evenly.

        Points far away, as in UTM, are sent from the first one: as 32-bit floats they would jump.
        """
        kept = thinned(vertices)
        is_far = len(kept) > 0 and np.abs(kept[0]).max() > _FAR_M
        origin = kept[0] if is_far else np.zeros(3)
        kept = kept - origin
        with self._scene.atomic():
            self._lines.position = origin
            self._lines.points = np.stack([kept[:-1], kept[1:]], axis=1).astype(np.float32)


class PathDrawing(Drawing):
    """A `Path`, or the outline of a `PolygonStamped`."""

    draws = (Path, PolygonStamped)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._line = Line(scene, f"{name}/line", color)
        self._vertices: npt.NDArray[np.floating] = np.zeros((0, 3))

    def draw(self, message: Any, appearance: Appearance) -> None:
        is_path = isinstance(message, Path)
        points = message.positions_xyz if is_path else message.points_xyz
        self._vertices = points[np.isfinite(points).all(axis=1)]
        end = self._vertices[: 0 if is_path else 1]
        self._line.show(np.concatenate([self._vertices, end]))

    def extent(self) -> npt.NDArray[np.floating]:
        return thinned(self._vertices)

    def reset(self) -> None:
        self._line.show(np.zeros((0, 3)))


class Trail:
    """The whole way of something that moves, in bounded memory.

    Positions nearer to each other than a spacing are skipped; when there are too many, every second
    one is dropped and the spacing doubles.
    """

    def __init__(self) -> None:
        self._room = np.empty((_MAX_VERTICES, 3))
        self._kept = 0
        self._spacing_m = _SPACING_M
        self._last: tuple[int, Floats] | None = None

    def add(self, stamp_ns: int, position_xyz: Floats) -> None:
        """Add a position (3,), unless it is late; after a jump, begin anew."""
        is_late = self._last is not None and stamp_ns < self._last[0]
        if is_late or not np.isfinite(position_xyz).all():
            return
        if self._last is not None and self._is_jump(stamp_ns, position_xyz):
            self.clear()
        self._last = stamp_ns, position_xyz
        way = self._room[: self._kept]
        if len(way) and np.linalg.norm(position_xyz - way[-1]) < self._spacing_m:
            return
        if len(way) == len(self._room):
            self._kept, self._spacing_m = len(way[::2]), 2 * self._spacing_m
            self._room[: self._kept] = way[::2].copy()
        self._room[self._kept] = position_xyz
        self._kept += 1

    def clear(self) -> None:
        self._kept, self._spacing_m, self._last = 0, _SPACING_M, None

    @property
    def vertices(self) -> Floats:
        """(N, 3): the positions kept, and the last one."""
        last = [] if self._last is None else [self._last[1]]
        return np.concatenate([self._room[: self._kept], np.reshape(last, (-1, 3))])

    def _is_jump(self, stamp_ns: int, position_xyz: Floats) -> bool:
        assert self._last is not None
        passed_s = (stamp_ns - self._last[0]) / _NS
        moved_m = float(np.linalg.norm(position_xyz - self._last[1]))
        return passed_s > 0 and moved_m > _MAX_SPEED_MPS * passed_s


def thinned(vertices: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    """Points (N, 3), evenly thinned where there are many; the first and the last are kept."""
    return vertices[evenly(len(vertices), _MAX_VERTICES)]
