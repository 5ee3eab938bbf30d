"""The tracks of satellite positions, seen from above."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nicegui.elements.leaflet as leaflet

from ros_visualise.ui.shell.panels import Panel


class Map(Panel, component="map.js"):
    """Positions over a grid in metres, or over tiles of a server that the user names."""

    title, icon = "Map", "map"
    help = "Satellite (GPS) positions and tracks on a map"

    def __init__(self, state: Mapping[str, Any], read_only: bool) -> None:
        super().__init__(state, read_only)
        self.add_resource(Path(leaflet.__file__).parent / "dist")
