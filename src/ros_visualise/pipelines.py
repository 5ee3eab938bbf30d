"""The pipelines, as graphs of nodes: what runs, and which topics join it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ros_visualise import params
from ros_visualise.data import (
    Image,
    NavSatFix,
    Odometry,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
)
from ros_visualise.errors import ParameterError, UsageError
from ros_visualise.messages import type_name
from ros_visualise.messages.calibrations import info_topic
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NodeType, SourceType, find
from ros_visualise.nodes.player import player
from ros_visualise.sources.frame_pairs import NamedPair, ask_for_pair, need_motion, parse_pair
from ros_visualise.sources.recordings import Recording


@dataclass(frozen=True)
class Node:
    """A node in a graph: its name there, its type, what it starts with, and its topics.

    ``inputs`` and ``outputs`` map the names in the node's declaration to topics.
    """

    name: str
    type: NodeType | SourceType
    params: Any
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]


@dataclass(frozen=True)
class Topic:
    """A topic: the class of its messages, the node that publishes it, and whether only on demand.

    ``ros`` is its type on a ROS graph and in recordings, and whether its last message holds.
    """

    type: type
    publisher: str
    on_demand: bool
    ros: TopicType


@dataclass(frozen=True)
class Graph:
    """Nodes in the order in which messages pass them; a source, if there is one, comes first."""

    nodes: tuple[Node, ...]

    @property
    def source(self) -> Node | None:
        """The node that everything starts from; None where messages come from outside."""
        return next((node for node in self.nodes if isinstance(node.type, SourceType)), None)

    @property
    def live(self) -> bool:
        """Whether what it starts from cannot wait for whoever is slow."""
        source = self.source
        return source is None or (isinstance(source.type, SourceType) and source.type.live)

    @property
    def makes_time(self) -> bool:
        """Whether its source tells what time it is."""
        source = self.source
        return source is not None and isinstance(source.type, SourceType) and source.type.makes_time

    @property
    def inputs(self) -> dict[str, type]:
        """The topics that come from outside, and the type of their messages."""
        return {
            topic: node.type.inputs[port]
            for node in self.nodes
            for port, topic in node.inputs.items()
            if topic not in self.topics
        }

    @property
    def topics(self) -> dict[str, Topic]:
        """Every topic by name, in the order of the nodes."""
        return {
            topic: _topic(node, port) for node in self.nodes for port, topic in node.outputs.items()
        }

    def node(self, name: str) -> Node:
        """The node of that name.

        Raises:
            UsageError: there is none; those that there are are listed.
        """
        for node in self.nodes:
            if node.name == name:
                return node
        raise UsageError(f"no node {name!r} here; there is {', '.join(n.name for n in self.nodes)}")

    def configured(self, settings: Mapping[str, Mapping[str, Any]]) -> Graph:
        """The same graph with other starting parameters: node -> parameter -> value.

        Raises:
            UsageError: no such node or parameter, or a value out of its range.
        """
        for name in settings:
            self.node(name)
        return Graph(tuple(_configure(node, settings.get(node.name, {})) for node in self.nodes))

    def insert(self, added: NodeType, after: str) -> Graph:
        """The same graph with a node of one's own, fed by the main output of ``after``.

        Whoever listened to that output listens to the new node's instead, if it is of that type.

        Raises:
            UsageError: no such node, the name is taken, or its input is not what ``after`` gives.
        """
        before = self.node(after)
        if any(node.name == added.name for node in self.nodes):
            raise UsageError(f"there is a node {added.name!r} already; name yours differently")
        port, topic = next(iter(before.outputs.items()))
        given = before.type.outputs[port]
        if list(added.inputs.values()) != [given]:
            raise UsageError(
                f"{added.name}: needs one input of type {given.__name__} after {after}"
            )
        new = place(added, {next(iter(added.inputs)): topic})
        taken = [output for output in new.outputs.values() if output in self.topics]
        if taken:
            raise UsageError(f"{added.name}: somebody publishes {taken[0]} already; rename yours")
        own = next((t for p, t in new.outputs.items() if added.outputs[p] is given), topic)
        nodes: list[Node] = []
        for node in self.nodes:
            inputs = {port: own if t == topic else t for port, t in node.inputs.items()}
            nodes += [replace(node, inputs=inputs)] + ([new] if node is before else [])
        return Graph(tuple(nodes))


IMAGE_NODES = ("fps_control", "filters", "edge_detector")
"""The nodes that images pass in the pipelines, in order."""

_OUTPUTS = {
    "fps_control": {"image": "/controlled_stream"},
    "filters": {"image": "/processed_image"},
    "edge_detector": {"edges": "/edges", "edges_overlay": "/edges_overlay"},
}


_SOURCE_TOPICS = {
    "image": "/image_raw",
    "imu": "/imu/data",
    "mag": "/imu/mag",
    "truth": "/ground_truth/odom",
}
"""Outputs of sources whose topics are not called as they are."""


def image_pipeline(source: str, **settings: Any) -> Graph:
    """``source`` -> fps_control -> filters -> edge_detector, on the topics of the ROS launch files.

    Args:
        source: name of a declared source of images.
        settings: its parameters.
    """
    added = tuple(_built_in(name) for name in IMAGE_NODES)
    return chain(added, source).configured({source: settings})


def chain(added: Sequence[NodeType], source: str | None = None) -> Graph:
    """Nodes that pass on images, each to the next, from ``source`` or the topic ``/image_raw``.

    Raises:
        UsageError: two of the same name, or one whose input is not what comes before it.
    """
    if source is None:
        return Graph(_chained(added))
    return Graph((_placed(find(source)), *_chained(added)))


def _chained(added: Sequence[NodeType], topic: str = "/image_raw") -> tuple[Node, ...]:
    """Nodes that pass on images, each to the next, the first from ``topic``."""
    nodes: tuple[Node, ...] = ()
    given = Image
    for declared in added:
        if any(node.name == declared.name for node in nodes):
            raise UsageError(f"{declared.name}: is there twice")
        if list(declared.inputs.values()) != [given]:
            raise UsageError(f"{declared.name}: needs one input of type {given.__name__}")
        node = place(declared, {next(iter(declared.inputs)): topic})
        nodes += (node,)
        topic = next((t for p, t in node.outputs.items() if declared.outputs[p] is given), topic)
    return nodes


def recording_pipeline(
    recording: Recording,
    topics: Collection[str] = (),
    image: str | None = None,
    odom: str | None = None,
) -> Graph:
    """A recording, one of its image topics through the image nodes, and its odometry to path.

    A recorded topic that is called as one that a node publishes, or as that of the calibration that
    goes with it, is played below ``/recorded``.

    Args:
        recording: it is open.
        topics: of these alone; none: of all.
        image: the topic of images; None: the first one, an empty text: none.
        odom: the topic that the path is made of, or a pair of frames, as
            `ros_visualise.sources.frame_pairs.parse_pair`; None: the first of odometry, else of
            poses, else of positions; an empty text: none.

    Raises:
        UsageError: a topic is not there or not of the right type.
    """
    declared = player(recording, topics)
    image = _choose(declared, "--image", image, (Image,))
    pair = _find_pair(recording, declared, odom) if odom else None
    odom = odom if pair else _choose(declared, "--odom", odom, tuple(_PATH_INPUTS))
    added = [_built_in(name) for name in IMAGE_NODES] if image else []
    made = {topic for node in added for topic in _OUTPUTS[node.name].values()}
    made |= {info_topic(topic) for topic in made} | ({"/path"} if odom else set())
    outputs = {name: f"/recorded{name}" if name in made else name for name in declared.outputs}
    nodes: tuple[Node, ...] = (Node("player", declared, declared.params(), {}, outputs),)
    nodes += _chained(added, outputs[image]) if image else ()
    if pair:
        nodes += (_following(pair, outputs),)
    elif odom:
        port = _PATH_INPUTS[declared.outputs[odom]]
        nodes += (place(_built_in("path"), {port: outputs[odom]}),)
    return Graph(nodes)


def simulation_pipeline(robot: str, **settings: Any) -> Graph:
    """A simulated robot, its images through the image nodes, and its odometry to path.

    Args:
        robot: name of a declared source that simulates one.
        settings: its parameters.
    """
    source = _placed(find(robot))
    images = _chained([_built_in(name) for name in IMAGE_NODES], source.outputs["image"])
    path = place(_built_in("path"), {"odom": source.outputs["odom"]})
    filters = {"threshold_mode": "off"}  # it would level the landmarks, which are bright
    return Graph((source, *images, path)).configured({robot: settings, "filters": filters})


_PATH_INPUTS: dict[type, str] = {
    Odometry: "odom",
    PoseStamped: "pose",
    PoseWithCovarianceStamped: "pose_cov",
    NavSatFix: "fix",
}
"""What path can follow -> its input, the best first."""


def _find_pair(recording: Recording, played: SourceType, odom: str) -> NamedPair | None:
    """The pair of frames that the path is to follow; None where it is to follow a topic."""
    if played.outputs.get(odom) is Transforms:
        raise UsageError(ask_for_pair(recording, f"--odom {odom}"))
    if ":" not in odom:
        return None
    pair = parse_pair(recording, odom)
    if pair.topic not in played.outputs:
        raise UsageError(f"--odom {odom}: {pair.topic} is not played; add it to --topics")
    pair = pair._replace(static=pair.static if pair.static in played.outputs else None)
    need_motion(recording, pair)
    return pair


def _following(pair: NamedPair, topics: Mapping[str, str]) -> Node:
    """The path node on the topics of a pair of frames."""
    inputs = {"tf": topics[pair.topic]}
    if pair.static:
        inputs["tf_static"] = topics[pair.static]
    frames = {"tf_parent": pair.parent, "tf_child": pair.child}
    return _configure(place(_built_in("path"), inputs), frames)


def _choose(
    source: SourceType, option: str, wanted: str | None, kinds: Sequence[type]
) -> str | None:
    """The topic that is wanted, or the first one of these kinds."""
    fitting = [name for kind in kinds for name, cls in source.outputs.items() if cls is kind]
    if wanted is None:
        return next(iter(fitting), None)
    if wanted and wanted not in fitting:
        there = ", ".join(fitting) or "none"
        names = " or ".join(kind.__name__ for kind in kinds)
        raise UsageError(f"{option} {wanted}: no such topic of {names}; there is {there}")
    return wanted or None


def path_pipeline() -> Graph:
    """The topic ``/odom`` -> path."""
    return alone(_built_in("path"))


def alone(declared: NodeType | SourceType) -> Graph:
    """One node by itself, on the topics that it has in the pipelines.

    A node that is in none listens to topics that are called as its inputs.
    """
    if isinstance(declared, SourceType):
        return chain((), declared.name)
    if declared.name in IMAGE_NODES:
        whole = chain([_built_in(name) for name in IMAGE_NODES])
        return Graph((whole.node(declared.name),))
    return Graph((place(declared, {port: f"/{port}" for port in declared.inputs}),))


def parse_node(text: str) -> tuple[str, str, str | None]:
    """``FILE.py:NAME[@AFTER]`` as (file, name, after); None where it does not say.

    Raises:
        UsageError: it is not of that form.
    """
    path, colon, name = text.rpartition(":")
    name, _, after = name.partition("@")
    if not colon or not name or Path(path).suffix != ".py":
        raise UsageError(f"{text}: give a node of your own as FILE.py:NAME or FILE.py:NAME@AFTER")
    return path, name, after or None


def place(declared: NodeType, inputs: Mapping[str, str]) -> Node:
    """A node in a graph, with its own parameters, on its topics of the pipelines if it is in them.

    Args:
        declared: its type.
        inputs: input name -> topic.
    """
    single = len(declared.outputs) == 1
    named = {port: f"/{declared.name}" if single else f"/{port}" for port in declared.outputs}
    outputs = _OUTPUTS.get(declared.name, named)
    return Node(declared.name, declared, declared.params(), inputs, outputs)


def _placed(source: NodeType | SourceType) -> Node:
    """A source on its topics of the pipelines."""
    inputs = {port: f"/{port}" for port in source.inputs}
    outputs = {port: _SOURCE_TOPICS.get(port, f"/{port}") for port in source.outputs}
    return Node(source.name, source, source.params(), inputs, outputs)


def _topic(node: Node, port: str) -> Topic:
    cls = node.type.outputs[port]
    known = node.type.ros.get(port) if isinstance(node.type, SourceType) else None
    ros = known or TopicType(type_name(cls), latched=port in node.type.latched)
    return Topic(cls, node.name, port in node.type.on_demand, ros)


def _built_in(name: str) -> NodeType:
    found = find(name)
    assert isinstance(found, NodeType)
    return found


def _configure(node: Node, changes: Mapping[str, Any]) -> Node:
    try:
        return replace(node, params=params.update(node.params, changes))
    except ParameterError as error:
        raise ParameterError(f"{node.name}: {error}") from None
