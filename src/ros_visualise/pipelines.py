"""The pipelines, as graphs of nodes: what runs, and which topics join it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ros_visualise import params
from ros_visualise.errors import ParameterError, UsageError
from ros_visualise.nodes import NodeType, SourceType, find


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
    """A topic: the type of its messages, the node that publishes it, and whether only on demand."""

    type: type
    publisher: str
    on_demand: bool


@dataclass(frozen=True)
class Graph:
    """Nodes in the order in which messages pass them; a source comes first."""

    nodes: tuple[Node, ...]

    @property
    def source(self) -> Node:
        """The node that everything starts from."""
        return self.nodes[0]

    @property
    def topics(self) -> dict[str, Topic]:
        """Every topic by name, in the order of the nodes."""
        return {
            topic: Topic(node.type.outputs[port], node.name, port in node.type.on_demand)
            for node in self.nodes
            for port, topic in node.outputs.items()
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
        new = _place(added, {next(iter(added.inputs)): topic})
        taken = [output for output in new.outputs.values() if output in self.topics]
        if taken:
            raise UsageError(f"{added.name}: somebody publishes {taken[0]} already; rename yours")
        own = next((t for p, t in new.outputs.items() if added.outputs[p] is given), topic)
        nodes: list[Node] = []
        for node in self.nodes:
            inputs = {port: own if t == topic else t for port, t in node.inputs.items()}
            nodes += [replace(node, inputs=inputs)] + ([new] if node is before else [])
        return Graph(tuple(nodes))


def image_pipeline(source: str, **settings: Any) -> Graph:
    """``source`` -> fps_control -> filters -> edge_detector, on the topics of the ROS launch files.

    Args:
        source: name of a declared source of images.
        settings: its parameters.
    """
    return Graph(
        (
            Node(source, found := find(source), found.params(), {}, {"image": "/image_raw"}),
            _built_in("fps_control", "/image_raw", {"image": "/controlled_stream"}),
            _built_in("filters", "/controlled_stream", {"image": "/processed_image"}),
            _built_in(
                "edge_detector",
                "/processed_image",
                {"edges": "/edges", "edges_overlay": "/edges_overlay"},
            ),
        )
    ).configured({source: settings})


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


def _built_in(name: str, image: str, outputs: Mapping[str, str]) -> Node:
    found = find(name)
    return Node(name, found, found.params(), {"image": image}, outputs)


def _place(added: NodeType, inputs: Mapping[str, str]) -> Node:
    single = len(added.outputs) == 1
    outputs = {port: f"/{added.name}" if single else f"/{port}" for port in added.outputs}
    return Node(added.name, added, added.params(), inputs, outputs)


def _configure(node: Node, changes: Mapping[str, Any]) -> Node:
    try:
        return replace(node, params=params.update(node.params, changes))
    except ParameterError as error:
        raise ParameterError(f"{node.name}: {error}") from None
