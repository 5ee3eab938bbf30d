"""The parameters, actions and texts of nodes."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Nodes(Panel, component="nodes.js"):
    """A part for each node, or for those that ``nodes`` in its state names."""

    title, icon, side, many = "Nodes", "tune", "left", True
    help = "Parameters of nodes: sliders, filters, presets, actions"
