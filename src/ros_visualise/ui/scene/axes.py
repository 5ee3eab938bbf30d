"""The frames of the tree, as axes with their names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser

from ros_visualise.data import Floats
from ros_visualise.geometry import transforms
from ros_visualise.ui.scene.drawing import Look, node_name, to_wxyz

_LENGTH, _RADIUS = 0.5, 0.014
_TEXT = 0.7
_LIFT = 0.06  # of a name above its axes, in lengths of the axes


class Axes:
    """Axes for every frame whose place is known."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._axes: viser.BatchedAxesHandle | None = None
        self._labels: dict[str, viser.LabelHandle] = {}

    def draw(self, places: Mapping[str, Floats], look: Look) -> None:
        """Show frames: name -> T_fixed_frame."""
        self._draw_axes(places, look)
        named = places if look.names else {}
        for name in self._labels.keys() - named.keys():
            self._labels.pop(name).remove()
        for name, T in named.items():
            if name not in self._labels:
                self._labels[name] = self._scene.add_label(
                    node_name("frames", name),
                    name,
                    font_screen_scale=_TEXT,
                    anchor="bottom-center",
                )
            self._labels[name].position = T[:3, 3] + [0, 0, _LIFT * look.axes_size]

    def _draw_axes(self, places: Mapping[str, Floats], look: Look) -> None:
        T = np.array(list(places.values())).reshape(-1, 4, 4)
        positions, quats_xyzw = transforms.to_pose(T)
        wxyzs = to_wxyz(quats_xyzw).astype(np.float32)
        if self._axes is not None and len(self._axes.batched_positions) != len(T):
            self._axes.remove()
            self._axes = None
        if self._axes is None:
            self._axes = self._scene.add_batched_axes(
                node_name("axes"),
                wxyzs,
                positions,
                np.full(len(T), look.axes_size, np.float32),
                axes_length=_LENGTH,
                axes_radius=_RADIUS,
            )
        self._axes.batched_wxyzs = wxyzs
        self._axes.batched_positions = positions.astype(np.float32)
        self._axes.batched_scales = np.full(len(T), look.axes_size, np.float32)
