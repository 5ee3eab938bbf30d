"""The view of cameras at first: from behind and above the robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats
from ros_visualise.ui.live.space.nodes import Grid, SpaceNode, View, ViewHints
from ros_visualise.ui.live.space.tree import SpaceTree

_NEAREST_M, _FARTHEST_M = 4.0, 28.0
_BEYOND_M = 1e9  # absurd coordinates; the largest map grids are below 1e7
_SHORTEST_M = 1e-3
_MOST = 70  # percent of what is drawn decides how far away from a robot the camera stands
_MOST_ALONE, _OUTSIDE = 85, 1.6  # the same without a robot, and so many times as far away
_BEHIND, _ABOVE, _AHEAD = 1.0, 0.62, 0.45
_SETTLED_S = 1.5
_GROWN = 1.3


class SceneView:
    """The world's node with its grid, and where cameras are that nobody has moved.

    Attributes:
        first: the view of new browsers, in place of the one that is computed.
        moved: the view of the camera that a person moved last; None if nobody did.
    """

    def __init__(self, tree: SpaceTree, clock: Callable[[], float]) -> None:
        self.first: View | None = None
        self.moved: View | None = None
        self._clock = clock
        self._started_s: float | None = None
        self._settled = False
        self._far = 0.0
        self._robot: Floats | None = None
        self._lowest_m = 0.0
        tree.add("/world", SpaceNode())
        self._grid = tree.add("/world/grid", Grid(visible=False))
        self._hints = tree.add("/view", ViewHints())
        self._extent: Callable[[], npt.NDArray[np.floating]] = lambda: np.zeros((0, 3))

    @property
    def home(self) -> View:
        """The view of cameras that nobody has moved."""
        return self._hints.home

    @property
    def shown(self) -> bool:
        """True if there is a scene; without one there is no grid."""
        return self._grid.visible

    @shown.setter
    def shown(self, shown: bool) -> None:
        self._grid.visible = shown

    def offer(self, places: Mapping[str, Floats]) -> None:
        """Offer frames to follow: name -> T_fixed_frame."""
        self._hints.frames = tuple(places)
        self._hints.places = np.array([T[:3, 3] for T in places.values()]).reshape(-1, 3)

    def restart(self) -> None:
        """Choose the view anew, as the fixed frame has changed."""
        self._started_s, self._settled, self._robot = None, False, None
        self._lowest_m = 0.0

    def update(
        self, T_fixed_robot: Floats | None, extent: Callable[[], npt.NDArray[np.floating]]
    ) -> None:
        """Follow the robot.

        Args:
            T_fixed_robot: 4x4, or None; its axes are zero if its heading is unknown.
            extent: returns points (N, 3) in the fixed frame that span everything.
        """
        if T_fixed_robot is not None and not _is_place(T_fixed_robot).all():
            T_fixed_robot = None
        self._robot, self._extent = T_fixed_robot, extent
        if T_fixed_robot is not None:  # after a time jump it stays in view until it comes again
            self._hints.robot = T_fixed_robot[:3, 3]
            if not T_fixed_robot[:3, 0].any():  # a track has no ground, and may go below its start
                self._lowest_m = min(self._lowest_m, float(T_fixed_robot[2, 3]))
                self._grid.position = (0.0, 0.0, self._lowest_m)
        if not self._settled:
            self._settle()

    def reset(self, for_all: bool = True) -> None:
        """Compute the view anew: behind and above the robot, or so that everything is seen.

        Args:
            for_all: forget the view that was saved.
        """
        if for_all:
            self.first = self.moved = None
        self._go_home()

    def _go_home(self) -> None:
        """Move all cameras that nobody has moved."""
        self._hints.home = self._pose() if self.first is None else self.first
        self._hints.homes += 1

    def _settle(self) -> None:
        """Choose the view as soon as there is something, and for a while again as it grows."""
        if not len(self._points()):
            return
        now_s, before = self._clock(), self._far
        if self._started_s is None:
            self._started_s, before = now_s, 0.0
        self._settled = now_s - self._started_s > _SETTLED_S
        self._pose()
        is_track = self._robot is not None and not self._robot[:3, 0].any()
        if self._far > _GROWN * before or (self._settled and is_track):  # its direction is known
            self._go_home()
        else:
            self._far = before

    def _points(self) -> npt.NDArray[np.floating]:
        """Points that span everything, without absurd ones."""
        points = self._extent()
        return points[_is_place(points).all(axis=1)]

    def _pose(self) -> View:
        """The view that is computed."""
        points, T = self._points(), self._robot
        if T is None:
            centre = np.median(points, axis=0) if len(points) else np.zeros(3)
            forward, ahead = np.array([0.8, 0.6, 0.0]), 0.0
            most, times, farthest = _MOST_ALONE, _OUTSIDE, np.inf
        else:
            centre, forward, ahead = T[:3, 3], _level(_heading(T, points)), _AHEAD
            most, times, farthest = _MOST, 1.0, _FARTHEST_M
        away = np.linalg.norm((points - centre)[:, :2], axis=1)
        far = times * float(np.percentile(away, most)) if len(points) else 0.0
        far = self._far = min(max(far, _NEAREST_M), farthest)
        up = np.array([0.0, 0.0, 1.0])
        origin = np.zeros(3) if T is None else T[:3, 3]
        position = centre - origin - forward * _BEHIND * far + up * _ABOVE * far
        target = centre - origin + forward * ahead * far
        x, y, z, *at = map(float, [*position, *target])
        return x, y, z, at[0], at[1], at[2]


def _heading(T_fixed_robot: Floats, points: npt.NDArray[np.floating]) -> Floats:
    """The robot's heading; if unknown, towards the middle of what is drawn."""
    ahead: Floats = T_fixed_robot[:3, 0]
    if ahead.any() or not len(points):
        return ahead
    middle: Floats = points.mean(axis=0) - T_fixed_robot[:3, 3]
    return middle


def _level(direction: Floats) -> Floats:
    """A direction (3,) without its height, of length 1."""
    level: Floats = direction * [1, 1, 0]
    length = float(np.linalg.norm(level))
    return level / length if length > _SHORTEST_M else np.array([1.0, 0, 0])


def _is_place(coordinates: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
    inside: npt.NDArray[np.bool_] = np.abs(coordinates) < _BEYOND_M  # NaN is not
    return inside
