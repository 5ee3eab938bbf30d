"""What a person has pointed at: pins with their coordinates, and the distance of two."""

from __future__ import annotations

import numpy as np
import viser

from ros_visualise.data import Floats
from ros_visualise.ui.scene.drawing import node_name

_COLOR = (255, 255, 255)
_RADIUS = 0.06
_TEXT = 0.9
_WIDTH_PX = 2.0


class Pins:
    """One or two places in the fixed frame."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._nodes: list[viser.SceneNodeHandle] = []

    def show(self, places_xyz: list[Floats], text: str, size_m: float) -> None:
        """Show these places (3,) instead of those before, a line between them, and a text there."""
        self.clear()
        for number, place in enumerate(places_xyz):
            ball = self._scene.add_icosphere(
                node_name("pins", str(number)), _RADIUS * size_m, _COLOR, position=place
            )
            self._nodes.append(ball)
        if len(places_xyz) > 1:
            line = np.array(places_xyz, np.float32)[None]
            self._nodes.append(
                self._scene.add_line_segments(
                    node_name("pins", "line"),
                    line,
                    _COLOR,
                    thickness=_WIDTH_PX,
                    thickness_units="screen",
                )
            )
        if places_xyz:
            self._nodes.append(
                self._scene.add_label(
                    node_name("pins", "text"),
                    text,
                    position=np.mean(places_xyz, axis=0),
                    font_screen_scale=_TEXT,
                    anchor="bottom-center",
                )
            )

    def clear(self) -> None:
        """Take them off the scene."""
        for node in self._nodes:
            node.remove()
        self._nodes = []
