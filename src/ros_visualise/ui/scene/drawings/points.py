"""Point clouds and laser scans, as points."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import LaserScan, Pixels, PointCloud
from ros_visualise.geometry.thinning import evenly
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Points
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.coloring import Coloring, by_value, colors_of, heights_of
from ros_visualise.ui.scene.drawing import Appearance, Drawing

Xyz = npt.NDArray[np.float32]
_HALF_RANGE_M = 128.0
"""Up to here a float of 16 bits is within 3 cm, and half the size of one of 32."""
_EXTENT_POINTS = 500


class _Dots(Drawing):
    """Points that all change from one message to the next."""

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self.coloring: Coloring = Coloring.AUTO
        self._points: Xyz = np.zeros((0, 3), np.float32)
        self._dots = scene.add(f"{name}/points", Points())

    def extent(self) -> npt.NDArray[np.floating]:
        return self._points[:: max(len(self._points) // _EXTENT_POINTS, 1)]

    def points(self) -> npt.NDArray[np.floating]:
        return self._points

    def reset(self) -> None:
        self._show(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))

    def _show(self, points: Xyz, colors: Pixels, size: float = 0.0) -> None:
        self._points = points
        is_near = np.abs(points).max(initial=0) < _HALF_RANGE_M
        with self._scene.atomic():
            self._dots.points = points.astype(np.float16 if is_near else np.float32)
            self._dots.colors = colors if colors.ndim > 1 else tuple(colors.tolist())
            if size:
                self._dots.size = size


class CloudDrawing(_Dots):
    """A `PointCloud`: its valid points, evenly thinned where there are many."""

    draws = (PointCloud,)

    colorings = Coloring

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, PointCloud)
        points, xyz = choose(message, appearance.max_points)
        heights = heights_of(xyz, self.T_fixed_frame)
        colors = colors_of(message, points, heights, self.coloring, self._color)
        self._show(xyz, colors, appearance.point_size)


class ScanDrawing(_Dots):
    """A `LaserScan`: the ends of its valid rays."""

    draws = (LaserScan,)

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, LaserScan)
        points, valid = ends_of(message)
        colors = np.array(self._color, np.uint8)
        if len(message.intensities) == len(message.ranges) and self.coloring is not Coloring.PLAIN:
            colors = by_value(message.intensities[valid])
        self._show(points, colors, 1.5 * appearance.point_size)


def choose(cloud: PointCloud, max_points: int) -> tuple[npt.NDArray[np.void], Xyz]:
    """Valid points of a cloud, in its layout (N,), and as (N, 3) metres."""
    points, xyz = cloud.points.ravel(), cloud.xyz
    finite = np.isfinite(xyz).all(axis=1)
    if not finite.all():
        points, xyz = points[finite], xyz[finite]
    if len(xyz) > max_points:
        chosen = evenly(len(xyz), max_points)
        points, xyz = points[chosen], xyz[chosen]
    return points, xyz


def ends_of(scan: LaserScan) -> tuple[Xyz, npt.NDArray[np.bool_]]:
    """Ends (N, 3) of the valid rays of a scan, metres in its frame, and which rays are (REP 117).

    Raises:
        DamagedMessage: its angles are not numbers.
    """
    if not np.isfinite([scan.angle_min, scan.angle_increment]).all():
        raise DamagedMessage("LaserScan: its angles are not numbers")
    ranges = scan.ranges
    valid = np.isfinite(ranges) & (ranges >= scan.range_min) & (ranges <= scan.range_max)
    angles = scan.angle_min + np.flatnonzero(valid) * scan.angle_increment
    x, y = ranges[valid] * np.cos(angles), ranges[valid] * np.sin(angles)
    return np.stack([x, y, np.zeros_like(x)], axis=1).astype(np.float32), valid
