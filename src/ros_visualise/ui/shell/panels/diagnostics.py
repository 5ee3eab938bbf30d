"""Diagnostics of the nodes of a graph."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Diagnostics(Panel, component="diagnostics.js"):
    """A line for each status, the worst first."""

    title, icon = "Diagnostics", "monitor_heart"
    help = "Health of the nodes: errors and warnings"
