"""Graphs of nodes: what runs, and which topics join it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from ros_visualise import params
from ros_visualise.errors import ParameterError, UsageError
from ros_visualise.messages import type_name
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NodeType, SourceType

M = TypeVar("M", bound="Member")


@dataclass(frozen=True)
class TopicSpec:
    """A topic: the class of its messages, who publishes it, and whether only on demand.

    ``ros`` is its type on a ROS graph and in recordings, and whether its last message holds.
    """

    type: type
    publisher: str
    on_demand: bool
    ros: TopicType


@dataclass(frozen=True)
class Member:
    """A node or a source in a graph: its name there, its type, what it starts with, its topics.

    ``inputs`` and ``outputs`` map the names in its declaration to topics.
    """

    name: str
    type: NodeType | SourceType
    params: Any
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]

    @property
    def topics(self) -> dict[str, TopicSpec]:
        """What it publishes, by the topics' names."""
        return {topic: self._topic(port) for port, topic in self.outputs.items()}

    def configured(self: M, changes: Mapping[str, Any]) -> M:
        """The same with other starting parameters.

        Raises:
            ParameterError: no such parameter, or a value out of its range.
        """
        try:
            return replace(self, params=params.update(self.params, changes))
        except ParameterError as error:
            raise ParameterError(f"{self.name}: {error}") from None

    def _topic(self, port: str) -> TopicSpec:
        cls = self.type.outputs[port]
        qos = LATCHED if port in self.type.latched else VOLATILE
        ros = TopicType(type_name(cls), qos=qos)
        return TopicSpec(cls, self.name, port in self.type.on_demand, ros)


@dataclass(frozen=True)
class Node(Member):
    """A node in a graph."""

    type: NodeType


@dataclass(frozen=True)
class SourceNode(Member):
    """What a graph starts from."""

    type: SourceType

    def _topic(self, port: str) -> TopicSpec:
        topic = super()._topic(port)
        return replace(topic, ros=self.type.ros.get(port, topic.ros))


class Change(Protocol):
    """Makes another of a node or a source."""

    def __call__(self, member: M, /) -> M:
        """What is to take its place."""


@dataclass(frozen=True)
class Graph:
    """A source, and nodes in the order in which messages pass them.

    Where messages come from outside, ``source`` is None.
    """

    source: SourceNode | None
    nodes: tuple[Node, ...]

    @property
    def members(self) -> tuple[Member, ...]:
        """The source, if there is one, and the nodes."""
        return (*(() if self.source is None else (self.source,)), *self.nodes)

    @property
    def live(self) -> bool:
        """Whether what it starts from cannot wait for whoever is slow."""
        return self.source is None or self.source.type.live

    @property
    def makes_time(self) -> bool:
        """Whether its source tells what time it is."""
        return self.source is not None and self.source.type.makes_time

    @property
    def inputs(self) -> dict[str, type]:
        """The topics that come from outside, and the type of their messages."""
        return {
            topic: node.type.inputs[port]
            for node in self.members
            for port, topic in node.inputs.items()
            if topic not in self.topics
        }

    @property
    def topics(self) -> dict[str, TopicSpec]:
        """Every topic by name, in the order of the nodes."""
        return {name: topic for one in self.members for name, topic in one.topics.items()}

    def node(self, name: str) -> Member:
        """The node or the source of that name.

        Raises:
            UsageError: there is none; those that there are are listed.
        """
        for member in self.members:
            if member.name == name:
                return member
        there = ", ".join(member.name for member in self.members)
        raise UsageError(f"no node {name!r} here; there is {there}")

    def changed(self, change: Change) -> Graph:
        """The same graph with another in place of each node and of the source."""
        source = None if self.source is None else change(self.source)
        return Graph(source, tuple(change(node) for node in self.nodes))

    def configured(self, settings: Mapping[str, Mapping[str, Any]]) -> Graph:
        """The same graph with other starting parameters: node -> parameter -> value.

        Raises:
            UsageError: no such node or parameter, or a value out of its range.
        """
        for name in settings:
            self.node(name)

        def configured(member: M) -> M:
            return member.configured(settings.get(member.name, {}))

        return self.changed(configured)

    def insert(self, added: NodeType, after: str) -> Graph:
        """The same graph with a node of one's own, fed by the main output of ``after``.

        Whoever listened to that output listens to the new node's instead, if it is of that type.

        Raises:
            UsageError: no such node, the name is taken, or its input is not what ``after`` gives.
        """
        before = self.node(after)
        if any(member.name == added.name for member in self.members):
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
        nodes = [new] if before is self.source else []
        for node in self.nodes:
            inputs = {port: own if t == topic else t for port, t in node.inputs.items()}
            nodes += [replace(node, inputs=inputs)] + ([new] if node is before else [])
        return Graph(self.source, tuple(nodes))


def place(
    declared: NodeType, inputs: Mapping[str, str], outputs: Mapping[str, str] | None = None
) -> Node:
    """A node in a graph, with its own parameters.

    Args:
        declared: its type.
        inputs: input name -> topic.
        outputs: output name -> topic; else a single output is called as the node, and several as
            they are.
    """
    single = len(declared.outputs) == 1
    named = {port: f"/{declared.name}" if single else f"/{port}" for port in declared.outputs}
    return Node(declared.name, declared, declared.params(), inputs, outputs or named)


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
