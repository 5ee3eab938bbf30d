"""The log of this program and of the nodes of a graph."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class LogPanel(Panel, component="log.js"):
    """A line for each report, the newest last."""

    title, icon, side = "Log", "article", "bottom"
    help = "Errors, warnings and other text output"
