"""Where the nodes stand that find landmarks: beside what else a graph does with its images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ros_visualise.data import Odometry, Transforms
from ros_visualise.graph import Graph, Node, place
from ros_visualise.nodes import find_node

TAGS, OBJECTS, RECORDED_TAGS = "tag_detector", "landmark_detector", "tag_poses"
LOCALIZER = "landmark_localizer"
DETECTORS = (TAGS, OBJECTS, RECORDED_TAGS)
"""The nodes that find landmarks in images, or take up what others have found there."""

_OUTPUTS = {
    OBJECTS: {"detections": "/object_detections", "debug_image": "/object_image"},
    LOCALIZER: {"markers": "/landmark_markers", "tf_static": "/landmarks/tf_static"},
}
"""Node -> output -> topic, where that is not called as the output.

The frames of landmarks have a topic of their own: a node that heard what it says would wait for
itself.
"""

_WORLDS = Path(__file__).parent / "simulation" / "worlds"  # to import that takes a second

Settings = Mapping[str, Mapping[str, Any]]


def with_landmarks(
    graph: Graph, topic: str, detectors: Sequence[str], settings: Settings = MappingProxyType({})
) -> Graph:
    """The same graph with nodes that find landmarks; where there are frames, also in a map.

    Args:
        graph: of any kind.
        topic: of images, or of detections that somebody made elsewhere.
        detectors: the nodes that take it.
        settings: node -> its parameters.

    Raises:
        ParameterError: no such parameter, or a value out of its range.
    """
    found = [_placed(name, [topic]) for name in detectors]
    if has_frames(graph):
        found.append(_localizer(graph, found))
    whole = replace(graph, nodes=(*graph.nodes, *found)).with_frames()
    names = [node.name for node in found]
    return whole.configured({name: settings[name] for name in names if name in settings})


def tags_of_world(name: str) -> str:
    """The file with the sizes of a simulated world's tags; empty where it has none."""
    path = _WORLDS / f"{name}_tags.yaml"
    return str(path) if path.is_file() else ""


def has_frames(graph: Graph) -> bool:
    """Whether it tells where its camera is."""
    return any(topic.type is Transforms for topic in graph.topics.values())


def _placed(name: str, taken: Sequence[str]) -> Node:
    """A node on these topics, in the order of its inputs."""
    declared = find_node(name)
    outputs = {port: f"/{port}" for port in declared.outputs} | _OUTPUTS.get(name, {})
    inputs = dict(zip(declared.stepped, taken, strict=False))
    return place(declared, inputs, outputs)


def _localizer(graph: Graph, detectors: Sequence[Node]) -> Node:
    """It takes what all of them find, and the odometry where there is one."""
    node = _placed(LOCALIZER, [detector.outputs["detections"] for detector in detectors])
    odometry = [name for name, one in graph.topics.items() if one.type is Odometry]
    known = {port: kind for port, kind in node.type.stepped.items() if kind is Odometry}
    if "/odom" in odometry and known:
        node = replace(node, inputs={**node.inputs, next(iter(known)): "/odom"})
    return node
