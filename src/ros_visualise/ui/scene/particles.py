"""Many poses at once, such as the places where a robot may be."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from ros_visualise.data import PoseArray
from ros_visualise.geometry import rotations
from ros_visualise.ui.scene.drawing import Color, Drawing, Look
from ros_visualise.ui.scene.lines import thinned

_LENGTH = 0.3
_THIN, _THICK, _HEAD = 0.012, 0.035, 0.1


class Particles(Drawing):
    """A `PoseArray`: an arrow along the x axis of each, in one element for all."""

    def __init__(self, scene: viser.SceneApi, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._arrows = scene.add_arrows(f"{name}/arrows", np.zeros((0, 2, 3)), color)
        self._positions: npt.NDArray[np.floating] = np.zeros((0, 3))

    def draw(self, message: Any, look: Look) -> None:
        assert isinstance(message, PoseArray)
        size = look.axes_size
        self._arrows.shaft_radius, self._arrows.head_radius = _THIN * size, _THICK * size
        self._arrows.head_length = _HEAD * size
        arrows = arrows_of(message, _LENGTH * size)
        self._positions = arrows[:, 0]
        self._arrows.points = arrows.astype(np.float32)

    def extent(self) -> npt.NDArray[np.floating]:
        return self._positions

    def reset(self) -> None:
        self._positions = np.zeros((0, 3))
        self._arrows.points = np.zeros((0, 2, 3), np.float32)


def arrows_of(poses: PoseArray, length_m: float) -> npt.NDArray[np.floating]:
    """Start and tip (N, 2, 3) of arrows along the poses' x axes; poses that are none are left out.

    Where there are very many, they are thinned evenly.
    """
    rows = np.concatenate([poses.positions_xyz, poses.quats_xyzw], axis=1)
    valid = np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 3:]).max(axis=1, initial=0) > 1e-6)
    kept = thinned(rows[valid])
    ahead = rotations.to_matrix(kept[:, 3:])[:, :, 0]
    return np.stack([kept[:, :3], kept[:, :3] + length_m * ahead], axis=1)
