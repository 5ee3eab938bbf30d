"""Where the nodes stand that find landmarks: beside what else a graph does with its images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Imu, Message, NavSatFix, Odometry, Transforms
from ros_visualise.graph import SOURCE_TOPICS, Graph, Node, place
from ros_visualise.nodes import find_node
from ros_visualise.simulation.worlds import WORLDS

TAGS, OBJECTS, RECORDED_TAGS = "tag_detector", "landmark_detector", "tag_poses"
LOCALIZER, NAVIGATOR = "landmark_localizer", "landmark_navigator"
LANDING, POSE_ERROR = "landing_target", "pose_error"
DETECTORS = (TAGS, OBJECTS, RECORDED_TAGS)
"""The nodes that find landmarks in images, or take up what others have found there."""

LANDING_INPUT = "landing_target_odom"
"""Of a source: where it is told where to land."""

_OBJECTS = {
    "detections": "/objects",
    "debug_image": "/objects_image",
    "vision_info": "/vision_info",
}
"""Its outputs beside a detector of tags."""

Settings = Mapping[str, Mapping[str, Any]]


def with_landmarks(
    graph: Graph,
    topic: str,
    detectors: Sequence[str],
    settings: Settings = MappingProxyType({}),
    navigate: bool = False,
) -> Graph:
    """The same graph with nodes that find landmarks; where there are frames, also in a map.

    A robot that lands by sight is told where its target is.

    Args:
        graph: of any kind.
        topic: of images, or of detections that somebody made elsewhere.
        detectors: the nodes that take it.
        settings: node -> its parameters.
        navigate: tell where the robot is in the map, instead of taking the frames' word for it.

    Raises:
        UsageError: one of their topics is there already, there is no odometry to correct, there is
            no such parameter, or a value is out of its range.
    """
    found = [_placed(name, topic) for name in detectors]
    detectors_there = tuple(found)
    if navigate:
        graph = _leaving_odom(graph)
        found.append(_navigator(graph, detectors_there))
        found += _judge(graph, found[-1])
    elif has_frames(graph):
        found.append(_fed(LOCALIZER, graph, detectors_there))
    if has_frames(graph) and graph.source is not None and LANDING_INPUT in graph.source.inputs:
        landing = _fed(LANDING, graph, detectors_there)
        found = [_without_moving(node, landing.params.target) for node in (*found, landing)]
    for made in (made for node in found for made in node.topics if made in graph.topics):
        raise UsageError(
            f"the recording has {made} already: leave it out by --topics, or leave out --landmarks"
        )
    whole = replace(graph, nodes=(*graph.nodes, *found)).with_frames()
    names = [node.name for node in found]
    return whole.configured({name: settings[name] for name in names if name in settings})


def tags_of_world(name: str) -> str:
    """The file with the sizes of a simulated world's tags.

    Raises:
        UsageError: there is no such world.
    """
    return str(WORLDS.find(name).tags)


def has_frames(graph: Graph) -> bool:
    """Whether it tells where its camera is."""
    return any(topic.type is Transforms for topic in graph.topics.values())


def _placed(name: str, topic: str) -> Node:
    """A detector on that topic."""
    declared = find_node(name)
    outputs = _OBJECTS if name == OBJECTS else None
    return place(declared, dict.fromkeys(declared.stepped, topic), outputs)


def _fed(name: str, graph: Graph, detectors: Sequence[Node]) -> Node:
    """A node that takes what all of them find, and the odometry where there is one."""
    declared = find_node(name)
    inputs = _found_by(detectors)
    if odometry := _odometry(graph):
        inputs["odom"] = odometry
    return place(declared, inputs)


def _found_by(detectors: Sequence[Node]) -> dict[str, str]:
    """Input -> topic of what each of them finds."""
    return {
        "objects" if one.name == OBJECTS else "detections": one.outputs["detections"]
        for one in detectors
    }


def _leaving_odom(graph: Graph) -> Graph:
    """The same; a simulated robot leaves it to the navigator to tell where odom is in map."""
    source = graph.source
    if source is None or not hasattr(source.params, "map_to_odom"):
        return graph
    return graph.configured({source.name: {"map_to_odom": False}})


def _without_moving(node: Node, classes: str) -> Node:
    """The same; who makes a map leaves out what robots land on, which may move."""
    return node.configured({"moving": classes}) if node.name in (LOCALIZER, NAVIGATOR) else node


def _navigator(graph: Graph, detectors: Sequence[Node]) -> Node:
    """It takes what they find, and corrects the odometry; an IMU and GPS help where they are."""
    declared = find_node(NAVIGATOR)
    odometry = _odometry(graph)
    if odometry is None or not has_frames(graph):
        what = "odometry" if odometry is None else "tf, which tells where the camera is,"
        raise UsageError(f"--navigate: there is no {what} here; leave it out")
    inputs = _found_by(detectors) | {"odometry": odometry}
    for name, type in (("imu", Imu), ("gps", NavSatFix)):
        if topic := _first(graph, type, SOURCE_TOPICS.get(name, "")):
            inputs[name] = topic
    return place(declared, inputs)


def _judge(graph: Graph, navigator: Node) -> list[Node]:
    """What holds its pose against the truth, where that is known."""
    truth = graph.topics.get(SOURCE_TOPICS["truth"])
    if truth is None or truth.type is not Odometry:
        return []
    declared = find_node(POSE_ERROR)
    inputs = {"pose": navigator.outputs["pose"], "truth": SOURCE_TOPICS["truth"]}
    return [place(declared, inputs)]


def _odometry(graph: Graph) -> str | None:
    """The topic of the odometry, if there is one: by its name, else the first that is no truth."""
    return _first(graph, Odometry, "/odom")


def _first(graph: Graph, type: type[Message], name: str) -> str | None:
    """A topic of that type: the one of that name, else the first."""
    several = [name for name, topic in graph.topics.items() if topic.type is type]
    return next((one for one in (name, *several) if one in several), None)
