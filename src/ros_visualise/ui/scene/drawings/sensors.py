"""Satellite fixes and inertial measurements."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage, NoTransform
from ros_visualise.data import Floats, Imu, NavSatFix
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.geodesy import LocalPlane
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Arrows, Axes, Solids, solid_row
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, to_wxyz
from ros_visualise.ui.scene.drawings.lines import Line, Trail, thinned
from ros_visualise.ui.scene.frames import Frames

_GRAVITY_MPS2 = 9.81
_LENGTH, _WIDTH, _DOT = 0.6, 0.04, 0.2
_AXES = _LENGTH, 0.015


class FixDrawing(Drawing):
    """A `NavSatFix`: a trail on the plane through the first one, x east, y north, z up.

    The first one is at the map's origin, unless its frame can be located.
    """

    draws = (NavSatFix,)

    gathers: ClassVar[bool] = True

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._plane: LocalPlane | None = None
        self._datum: Floats | None = None
        self.T_frame_body: Floats = np.diag([0.0, 0, 0, 1])  # its heading is unknown
        self._trail = Trail()
        self._vertices: npt.NDArray[np.floating] = np.zeros((0, 3))
        self._line = Line(scene, f"{name}/trail", color)
        self._whole = Line(scene, f"{name}/whole", color, faint=True)
        self._track: Floats = np.zeros((0, 3))
        self._drawn: object = None
        self._dot = scene.add(f"{name}/fix", Solids(shape="sphere", visible=False))

    def gather(self, message: Any, now_ns: int) -> None:
        """Continue the trail from the very first fix."""
        position = self._on_plane(message)
        if position is not None:
            self._trail.add(message.header.stamp_ns, position)

    def draw(self, message: Any, appearance: Appearance) -> None:
        position = self._on_plane(message)
        if position is None:
            return
        datum = np.zeros(3) if self._datum is None else self._datum
        self.T_frame_body[:3, 3] = datum + position
        self._vertices = datum + self._trail.vertices
        self._show_whole(datum)
        self._line.show(self._vertices)
        size = [_DOT * appearance.axes_size] * 3
        self._dot.position, self._dot.rows = datum + position, solid_row(size, self._color)
        self._dot.visible = True

    def show_track(self, places: Floats) -> None:
        """Draw all of the way, faintly: latitude, longitude and height (N, 3)."""
        self._track, self._drawn = places, None

    def _show_whole(self, datum: Floats) -> None:
        """Draw it on the plane, unless that is done."""
        drawn = self._plane, datum.tolist()
        if self._plane is not None and self._drawn != drawn:
            self._drawn = drawn
            self._whole.show(datum + self._plane.to_enu(self._track))

    def frame_of(self, message: Any, frames: Frames) -> str:
        return "map" if "map" in frames.names else ""

    def settle(self, message: Any, frames: Frames) -> None:
        position = self._on_plane(message)
        frame = message.header.frame_id
        if self._datum is not None or position is None or frame in ("", frames.fixed):
            return
        with suppress(NoTransform):
            T_fixed_sensor = frames.locate(frame, message.header.stamp_ns)
            T_frame_sensor = se3.inverse(self.T_fixed_frame) @ T_fixed_sensor
            self._datum = T_frame_sensor[:3, 3] - position

    def extent(self) -> npt.NDArray[np.floating]:
        return thinned(self._vertices)

    def reset(self) -> None:
        self._plane = self._datum = None
        self._trail.clear()
        self._vertices = np.zeros((0, 3))
        self._line.show(self._vertices)

    def _on_plane(self, fix: NavSatFix) -> Floats | None:
        """Metres east, north and up of the first fix; None for an invalid one."""
        place = np.array([fix.latitude, fix.longitude, fix.altitude])
        place[2] = np.nan_to_num(place[2])  # a fix may lack its height
        if fix.status < 0 or not np.isfinite(place).all():
            return None
        if self._plane is None:
            self._plane = LocalPlane(*place)
        return self._plane.to_enu(place)


class ImuDrawing(Drawing):
    """An `Imu`: an arrow for the acceleration, as long as the axes at 1 g, and axes for the
    attitude in the fixed frame."""

    draws = (Imu,)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._axes = scene.add(f"{name}/attitude", Axes(origin=color))
        self._arrow = scene.add(f"{name}/acceleration", Arrows(color=color))

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, Imu)
        self._axes.visible = message.orientation_covariance[0, 0] != -1
        self._axes.length, self._axes.radius = np.array(_AXES) * appearance.axes_size
        if self._axes.visible:
            self._axes.wxyz = to_wxyz(self._attitude(message))
        self._arrow.visible = bool(
            message.linear_covariance[0, 0] != -1 and np.isfinite(message.linear_xyz).all()
        )
        if self._arrow.visible:
            tip = message.linear_xyz / _GRAVITY_MPS2 * _LENGTH * appearance.axes_size
            self._arrow.width = _WIDTH * appearance.axes_size
            self._arrow.points = np.stack([np.zeros(3), tip])[None].astype(np.float32)

    def _attitude(self, message: Imu) -> npt.NDArray[np.float64]:
        """Attitude relative to the sensor's frame, which may be rotated already."""
        try:
            R_fixed_sensor = rotations.to_matrix(message.quat_xyzw)
        except ValueError as error:
            raise DamagedMessage(f"Imu: {error}") from None
        return rotations.from_matrix(self.T_fixed_frame[:3, :3].T @ R_fixed_sensor)
