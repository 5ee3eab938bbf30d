"""Standard layouts of the workspace, by what a graph has to show."""

from __future__ import annotations

from ros_visualise.graph import Graph


def standard_layout(graph: Graph | None) -> object:
    """The layout for addresses without one."""
    return {"panel": "viser"}
