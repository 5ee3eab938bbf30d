"""Objects detected in 3D, as transparent boxes with their classes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Detections3D
from ros_visualise.geometry import se3
from ros_visualise.plotting.colors import Color, color_of
from ros_visualise.ui.live.space.nodes import Label
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing
from ros_visualise.ui.scene.solids import SolidBatch

_ALPHA = 0.4
_MOST_LABELS = 50
_BOXES = "boxes"


class DetectedBoxes(Drawing):
    """A `Detections3D`: the boxes of one class have one colour."""

    draws = (Detections3D,)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._boxes = SolidBatch(scene, f"{name}/boxes", "cube")
        self._labels: list[Label] = []
        self._places: npt.NDArray[np.floating] = np.zeros((0, 3))

    def draw(self, message: Any, appearance: Appearance) -> None:
        assert isinstance(message, Detections3D)
        several = message.detections
        try:
            T = np.array(
                [se3.from_pose(one.position_xyz, one.quat_xyzw) for one in several]
            ).reshape(-1, 4, 4)
        except ValueError as error:
            raise DamagedMessage(f"Detections3D: {error}") from None
        sizes = np.array([one.size_xyz for one in several]).reshape(-1, 3)
        if not (np.isfinite(T).all() and np.isfinite(sizes).all()):
            raise DamagedMessage("Detections3D: a box has a value that is not a number")
        colors = np.array([color_of(one.class_id) for one in several]).reshape(-1, 3) / 255
        rgba = np.column_stack([colors, np.full(len(several), _ALPHA)])
        self._boxes.put(_BOXES, (T, sizes, rgba))
        self._boxes.show()
        self._places = T[:, :3, 3]
        tops = self._places + [0, 0, 0.5] * sizes
        self._label([(one.label, top) for one, top in zip(several, tops, strict=True)])

    def extent(self) -> npt.NDArray[np.floating]:
        return self._places

    def reset(self) -> None:
        self._boxes.drop(_BOXES)
        self._boxes.show()
        self._label([])
        self._places = np.zeros((0, 3))

    def _label(self, texts: list[tuple[str, npt.NDArray[np.floating]]]) -> None:
        """Replace the labels: texts at places."""
        for number, (text, position) in enumerate(texts[:_MOST_LABELS]):
            if number == len(self._labels):
                self._labels.append(self._scene.add(f"{self._name}/label{number}", Label()))
            label = self._labels[number]
            label.text, label.position = text, position
            label.visible = bool(text)
        for label in self._labels[len(texts) :]:
            label.visible = False
