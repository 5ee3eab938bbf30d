"""The robot itself, by its description: its links follow their frames."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser

from ros_visualise.data import Floats
from ros_visualise.ui.scene.drawing import move, node_name
from ros_visualise.ui.urdf import Shape, read_shapes


class Robot:
    """The shapes of a robot's links; nothing until it is described."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._text = ""
        self._links: dict[str, viser.FrameHandle] = {}

    def describe(self, text: str) -> None:
        """Look as this URDF says.

        Raises:
            ValueError: it is none.
        """
        if text == self._text:
            return
        shapes = read_shapes(text)
        self._text = text
        for link in self._links.values():
            link.remove()
        self._links = {}
        for number, shape in enumerate(shapes):
            self._add(number, shape)

    def place(self, places: Mapping[str, Floats]) -> None:
        """Put each link where its frame is; those whose frame is not known are hidden.

        Args:
            places: frame -> T_fixed_frame.
        """
        for name, link in self._links.items():
            link.visible = name in places
            if link.visible:
                move(link, places[name])

    def _add(self, number: int, shape: Shape) -> None:
        if shape.link not in self._links:
            name = node_name("robot", shape.link)
            self._links[shape.link] = self._scene.add_frame(name, show_axes=False, visible=False)
        name = f"{node_name('robot', shape.link)}/{number}"
        red, green, blue = (round(255 * c) for c in shape.rgba[:3])
        color, scene = (red, green, blue), self._scene
        handle: viser.SceneNodeHandle
        if shape.kind == "box":
            handle = scene.add_box(name, color, np.array(shape.size))
        elif shape.kind == "cylinder":
            radius, length = shape.size
            handle = scene.add_cylinder(name, radius, length, color=color)
        else:
            handle = scene.add_icosphere(name, shape.size[0], color)
        move(handle, shape.T_link_shape)
