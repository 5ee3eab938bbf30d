"""A drawing: the magnetic field as an arrow."""

from typing import Any

import numpy as np

from ros_visualise.data import MagneticField
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Arrows
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing


class Compass(Drawing):
    """A `MagneticField`: an arrow along it, as long as the axes of frames."""

    draws = (MagneticField,)

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._arrow = scene.add(f"{name}/field", Arrows(color=color))

    def draw(self, message: Any, appearance: Appearance) -> None:
        field = np.asarray(message.field_xyz, np.float64)
        size = np.linalg.norm(field)
        tip = field / size * appearance.axes_size if size > 0 else field
        self._arrow.points = np.array([[np.zeros(3), tip]])
