"""Many poses at once, such as a particle filter's."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.data import PoseArray
from ros_visualise.geometry import rotations
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Lines
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing
from ros_visualise.ui.scene.drawings.lines import thinned

_NO_LINES = np.zeros((0, 2, 3), np.float32)
_LEAST = 1e-6  # a shorter quaternion is no rotation
_LENGTH, _WIDTH_PX = 0.3, 1.5
_ARROW = np.array([[[0, 0], [1, 0]], [[1, 0], [0.7, 0.15]], [[1, 0], [0.7, -0.15]]])
"""Its lines: start and end of each, along the x and the y axis of a pose, in lengths."""


class ParticlesDrawing(Drawing):
    """A `PoseArray`: a flat arrow along the x axis of each, in one element for all."""

    draws = (PoseArray,)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._lines = scene.add(f"{name}/arrows", Lines(colors=color, width=_WIDTH_PX))
        self._positions: npt.NDArray[np.floating] = np.zeros((0, 3))

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, PoseArray)
        arrows = arrows_of(message, _LENGTH * appearance.axes_size)
        self._positions = arrows[::3, 0]
        self._lines.points = arrows.astype(np.float32)

    def extent(self) -> npt.NDArray[np.floating]:
        return self._positions

    def reset(self) -> None:
        self._positions, self._lines.points = np.zeros((0, 3)), _NO_LINES


def arrows_of(poses: PoseArray, length_m: float) -> npt.NDArray[np.floating]:
    """Start and end (3 N, 2, 3) of the lines of arrows, three for each valid pose."""
    rows = np.concatenate([poses.positions_xyz, poses.quats_xyzw], axis=1)
    valid = np.isfinite(rows).all(axis=1) & (np.linalg.norm(rows[:, 3:], axis=1) > _LEAST)
    kept = thinned(rows[valid])
    along = rotations.to_matrix(kept[:, 3:])[:, :, :2]
    lines: npt.NDArray[np.floating] = np.einsum("nij,lej->nlei", along, length_m * _ARROW)
    return (lines + kept[:, None, None, :3]).reshape(-1, 2, 3)
