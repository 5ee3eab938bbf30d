"""The graph of nodes and topics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.ui.shell.panels import Panel


class GraphPicture(Panel, component="picture.js"):
    """A picture of nodes as boxes, with the topics between them."""

    title, icon = "Graph", "schema"
    help = "Diagram of nodes and the topics between them"

    def __init__(self, state: Mapping[str, Any], read_only: bool) -> None:
        super().__init__(state, read_only)
        self._props["name"] = "graph"
