"""The page of viser, with the elements that are its own."""

from __future__ import annotations

from ros_visualise.ui.shell.panels import Panel


class ViserPage(Panel, component="viser.js"):
    """A frame with that page."""

    title, icon, side = "Graph", "account_tree", "left"
