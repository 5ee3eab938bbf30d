"""The tree of coordinate frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.ui.shell.panels import Panel


class FramesPicture(Panel, component="picture.js"):
    """A picture of frames below their parents, with rates and ages."""

    title, icon = "Frames", "lan"
    help = "Tree of coordinate frames (tf)"

    def __init__(self, state: Mapping[str, Any], read_only: bool) -> None:
        super().__init__(state, read_only)
        self._props["name"] = "frames"
