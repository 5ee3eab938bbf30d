"""Standard layouts of the workspace, by what a graph has to show."""

from __future__ import annotations

from ros_visualise.graph import Graph
from ros_visualise.ui.shown import first_shown

_MOST_IMAGES = 4


def standard_layout(graph: Graph | None) -> object:
    """The layout for addresses without one: the first images of the nodes, beside the rest."""
    rest = {"panel": "viser"}
    if graph is None:
        return rest
    shown = [first_shown(graph, node) for node in graph.members if not node.aside]
    topics = [topic for topic in dict.fromkeys(shown) if topic][:_MOST_IMAGES]
    images = [{"panel": "image", "state": {"topic": topic}} for topic in topics]
    if not images:
        return rest
    half = (len(images) + 1) // 2
    columns = [images[:half], images[half:]] if len(images) > 2 else [images]
    placed = [one[0] if len(one) == 1 else {"column": one} for one in columns]
    return {"row": [rest, *placed], "at": [0.4, *[0.6 / len(placed)] * len(placed)]}
