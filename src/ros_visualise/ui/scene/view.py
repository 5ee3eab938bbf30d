"""The cameras of the scene: behind and above the robot at first, and along with it."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import Floats

_NEAREST_M, _FARTHEST_M = 4.0, 28.0
_BEYOND_M = 1e9  # absurd coordinates; the largest map grids are below 1e7
_SHORTEST_M = 1e-3
_MOST = 70  # percent of what is drawn decides how far away from a robot the camera stands
_MOST_ALONE, _OUTSIDE = 85, 1.6  # the same without a robot, and so many times as far away
_BEHIND, _ABOVE, _AHEAD = 1.0, 0.62, 0.45
_SAME = 0.01  # a view that is moved by less, as a part of its distance, was not moved
_SETTLED_S = 1.5
_GROWN = 1.3
_FOV = np.radians(50)

_GRID = {"cell_size": 1.0, "section_size": 10.0, "cell_thickness": 0.6, "section_thickness": 1.0}


class SceneView:
    """The world's node with its grid, and the cameras of all browsers.

    To follow the robot (``follows``), the world moves under the cameras: motion is smooth however
    people move these, and coordinates stay small. ``onlookers`` returns the numbers of the browsers
    whose views are not saved.
    """

    def __init__(self, server: viser.ViserServer, clock: Callable[[], float]) -> None:
        self.follows = True
        self.onlookers: Callable[[], Collection[int]] = tuple
        self._server, self._clock = server, clock
        self._started_s: float | None = None
        self._settled = False
        self._far = 0.0
        self._offset = np.zeros(3)
        self._robot: Floats | None = None
        self._held: Floats | None = None
        self._wanted: dict[int, tuple[Floats, Floats]] = {}  # browser -> where it wants to look
        self._first: tuple[Floats, Floats] | None = None  # where all others are to look
        self._world = server.scene.add_frame("/world", show_axes=False)
        self._extent: Callable[[], npt.NDArray[np.floating]] = lambda: np.zeros((0, 3))
        self._grid = server.scene.add_grid(
            "/world/grid",
            visible=False,
            infinite_grid=True,
            cell_color=(70, 74, 80),
            section_color=(100, 106, 114),
            fade_distance=90.0,
            fade_strength=1.5,
            **_GRID,  # type: ignore[arg-type]
        )

    @property
    def offset(self) -> Floats:
        """Origin of the fixed frame, (3,) metres in the coordinates of the cameras."""
        return self._offset

    @property
    def anchor(self) -> Floats:
        """Origin of saved views, (3,) metres in the coordinates of the cameras: the robot that is
        followed, else the fixed frame."""
        return self._offset if self._held is None or not self.follows else self._offset + self._held

    def look_from(self, client: int | None, position: Floats, look_at: Floats) -> None:
        """Move a camera.

        Args:
            client: the number of the browser; None: all new ones, until the view is reset.
            position, look_at: (3,) metres each, from the `anchor`.
        """
        if client is None:
            self._first = position, look_at
            return
        if not self._settled:
            self._wanted[client] = position, look_at
        self._show(client, position + self.anchor, look_at + self.anchor)

    @property
    def moved(self) -> tuple[Floats, Floats] | None:
        """Position and target of the camera that was moved last, (3,) metres each from the
        `anchor`; None if none was moved."""
        onlookers = self.onlookers()
        there = self._server.get_clients().items()
        clients = [client for number, client in there if number not in onlookers]
        if not clients or not self.shown:
            return None
        camera = max(clients, key=lambda client: client.camera.update_timestamp).camera
        distance = np.linalg.norm(camera.position - self._server.initial_camera.position)
        if self._first is None and distance < _SAME * self._far:
            return None
        return camera.position - self.anchor, camera.look_at - self.anchor

    @property
    def shown(self) -> bool:
        """True if there is a scene; without one there is no grid."""
        return self._grid.visible

    @shown.setter
    def shown(self, shown: bool) -> None:
        self._grid.visible = shown

    def restart(self) -> None:
        """Choose the view anew, as the fixed frame has changed."""
        self._started_s, self._settled, self._robot, self._held = None, False, None, None

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
        robot = None if T_fixed_robot is None else T_fixed_robot[:3, 3]
        if not self.follows:
            self._held = None
        elif robot is not None:  # after a time jump it is somewhere else, and stays in view
            if self._held is not None:
                self._offset = self._offset + self._held - robot
                self._world.position = self._offset
            self._held = robot
        if not self._settled:
            self._settle()

    def reset(self) -> None:
        """Move all cameras behind and above the robot, or so that they see everything."""
        self._wanted.clear()
        self._first = None
        self._show_all()

    def _show_all(self) -> None:
        """Move all cameras, except those that look elsewhere."""
        position, look_at = self._pose()
        if self._first is not None:
            position, look_at = (place + self.anchor for place in self._first)
        initial = self._server.initial_camera
        initial.position, initial.look_at, initial.fov = position, look_at, float(_FOV)
        for client in self._server.get_clients():
            self._show(client, position, look_at)
        for client, (position, look_at) in self._wanted.items():
            self._show(client, position + self.anchor, look_at + self.anchor)

    def _show(self, client: int, position: Floats, look_at: Floats) -> None:
        there = self._server.get_clients().get(client)
        if there is not None:
            with there.atomic():
                there.camera.position, there.camera.look_at = position, look_at
                there.camera.fov = float(_FOV)

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
            self._show_all()
        else:
            self._far = before
        if self._settled:
            self._wanted.clear()

    def _points(self) -> npt.NDArray[np.floating]:
        """Points that span everything, without absurd ones."""
        points = self._extent()
        return points[_is_place(points).all(axis=1)]

    def _pose(self) -> tuple[Floats, Floats]:
        """Position and target of the camera, in the coordinates of the cameras."""
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
        position = centre + self._offset - forward * _BEHIND * far + up * _ABOVE * far
        return position, centre + self._offset + forward * ahead * far


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
