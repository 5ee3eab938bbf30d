"""The 3D view."""

from __future__ import annotations

import nicegui.elements.scene  # noqa: F401  # which brings three.js

from ros_visualise.ui.shell.panels import Panel


class Space(Panel, component="space.js"):
    """A canvas with the 3D view, and the settings of what is drawn."""

    title, icon, side, many = "3D", "view_in_ar", "middle", True
    help = "Robots, point clouds, paths and markers in 3D, as in RViz"
