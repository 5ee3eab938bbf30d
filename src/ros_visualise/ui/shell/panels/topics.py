"""The topics of a graph, with rates, drops and latencies."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class Topics(Panel, component="topics.js"):
    """A table with a line for each topic."""

    title, icon = "Topics", "list"
    help = "Topics with rates in Hz, delays and drops"
