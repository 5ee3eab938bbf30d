"""Standard layouts of the workspace, by what a graph has to show."""

from __future__ import annotations

from collections.abc import Mapping

from ros_visualise.graph import Graph
from ros_visualise.ui.scene.thread import topics_of
from ros_visualise.ui.shown import first_shown

Written = Mapping[str, object]
"""A panel as `read_layout` has it."""
_MOST_IMAGES, _MOST_BESIDE_SCENE = 4, 3


def standard_layout(graph: Graph | None) -> object:
    """The layout for addresses without one: 3D and the nodes' first images, beside the rest."""
    rest = {"panel": "viser"}
    if graph is None:
        return rest
    scenes: list[list[Written]] = [[{"panel": "space"}]] if topics_of(graph) else []
    shown = [first_shown(graph, node) for node in graph.members if not node.aside]
    topics = [topic for topic in dict.fromkeys(shown) if topic]
    topics = topics[: _MOST_BESIDE_SCENE if scenes else _MOST_IMAGES]
    images: list[Written] = [{"panel": "image", "state": {"topic": topic}} for topic in topics]
    half = len(images) if scenes or len(images) < 3 else (len(images) + 1) // 2
    columns = [column for column in (*scenes, images[:half], images[half:]) if column]
    if not columns:
        return rest
    placed = [one[0] if len(one) == 1 else {"column": one} for one in columns]
    return {"row": [rest, *placed], "at": [0.4, *[0.6 / len(placed)] * len(placed)]}
