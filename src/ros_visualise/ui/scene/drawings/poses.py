"""Poses: axes, a trail and the uncertainty."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import (
    Floats,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    TransformStamped,
)
from ros_visualise.geometry import rotations, se3
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Axes, Solids, solid_row
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, move, to_wxyz
from ros_visualise.ui.scene.drawings.lines import Line, Trail, thinned

Posed = Odometry | PoseStamped | PoseWithCovarianceStamped | TransformStamped
_SIGMAS = 2.0
_AXES = 0.5, 0.012
_MIN_SIGMA_M = 1e-3


class PoseDrawing(Drawing):
    """A message with one pose: axes, a trail, and an ellipsoid of two standard deviations."""

    draws = (Odometry, PoseStamped, PoseWithCovarianceStamped, TransformStamped)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self.T_frame_body: Floats = np.eye(4)
        self._axes = scene.add(f"{name}/axes", Axes(origin=color))
        self._line = Line(scene, f"{name}/trail", color)
        self._whole = Line(scene, f"{name}/whole", color, faint=True)
        self._trail = Trail()
        self._ellipsoid = scene.add(f"{name}/covariance", Solids(shape="sphere", visible=False))

    def draw(self, message: Any, appearance: Appearance) -> None:
        self.T_frame_body = pose_of(message)
        self._axes.length, self._axes.radius = np.array(_AXES) * appearance.axes_size
        move(self._axes, self.T_frame_body)
        self._trail.add(message.header.stamp_ns, self.T_frame_body[:3, 3])
        self._line.show(self._trail.vertices)
        covariance = covariance_of(message) if appearance.covariances else None
        self._ellipsoid.visible = covariance is not None
        if covariance is not None:
            half_axes, self._ellipsoid.wxyz = ellipsoid(covariance)
            self._ellipsoid.position = self.T_frame_body[:3, 3]
            self._ellipsoid.rows = solid_row(2 * np.array(half_axes), self._color, 0.3)

    def show_track(self, places: Floats) -> None:
        """Draw all of the way (N, 3), faintly."""
        self._whole.show(places)

    def extent(self) -> npt.NDArray[np.floating]:
        return thinned(self._trail.vertices)

    def reset(self) -> None:
        self._trail.clear()
        self._line.show(np.zeros((0, 3)))


def pose_of(message: Posed) -> Floats:
    """T_frame_body, 4x4, in the frame of the message's header.

    Raises:
        DamagedMessage: its quaternion is zero, or a value is not a number.
    """
    is_transform = isinstance(message, TransformStamped)
    position = message.translation_xyz if is_transform else message.position_xyz  # type: ignore[union-attr]
    try:
        T_frame_body = se3.from_pose(position, message.quat_xyzw)
    except ValueError as error:
        raise DamagedMessage(f"{type(message).__name__}: {error}") from None
    if not np.isfinite(T_frame_body).all():
        raise DamagedMessage(f"{type(message).__name__}: its pose has a value that is not a number")
    return T_frame_body


def covariance_of(message: Posed) -> Floats | None:
    """Covariance of the position, 3x3 in m^2; None where unknown."""
    if isinstance(message, Odometry):
        found = message.pose_covariance[:3, :3]
    elif isinstance(message, PoseWithCovarianceStamped):
        found = message.covariance[:3, :3]
    else:
        return None
    return found if found.any() and np.isfinite(found).all() else None


def ellipsoid(covariance: Floats) -> tuple[tuple[float, float, float], Floats]:
    """Half axes in metres of two standard deviations, and the ellipsoid's attitude (w, x, y, z)."""
    variances, axes = np.linalg.eigh(covariance)
    axes[:, 2] *= np.sign(np.linalg.det(axes))  # a rotation, no mirror
    a, b, c = _SIGMAS * np.sqrt(np.maximum(variances, _MIN_SIGMA_M**2))
    return (float(a), float(b), float(c)), to_wxyz(rotations.from_matrix(axes))
