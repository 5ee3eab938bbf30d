"""What of a node's images is shown."""

from __future__ import annotations

from ros_visualise.data import Image
from ros_visualise.graph import Graph, Member


def images_of(node: Member) -> list[str]:
    """The topics on which a node publishes images."""
    return [topic for port, topic in node.outputs.items() if node.type.outputs[port] is Image]


def first_shown(graph: Graph, node: Member) -> str | None:
    """The one that is shown first: that which another node takes, else the first; None of none."""
    taken = {topic for other in graph.members for topic in other.inputs.values()}
    images = images_of(node)
    return next((topic for topic in images if topic in taken), next(iter(images), None))
