"""Graphs of nodes: what runs, and which topics join it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Protocol, TypeVar

from ros_visualise.core import params
from ros_visualise.core.declarations import TRANSFORMS
from ros_visualise.core.errors import ParameterError, UsageError, did_you_mean
from ros_visualise.messages import type_name
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NodeType, SourceType

M = TypeVar("M", bound="Member")

SOURCE_TOPICS = {
    "image": "/image_raw",
    "imu": "/imu/data",
    "mag": "/imu/mag",
    "truth": "/ground_truth/odom",
    "pad": "/ground_truth/pad",
}
"""Output of a source -> its topic, where that is not named after the output."""


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

    ``inputs`` and ``outputs`` map the names in its declaration to topics. ``aside``: others show
    what it does, so that a page need not begin with a window for it.
    """

    name: str
    type: NodeType | SourceType
    params: Any
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    aside: bool = False

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

    def configured(self, changes: Mapping[str, Any]) -> SourceNode:
        """The same with other starting parameters; one of them may bring more of them."""
        decisive, extend = self.type.extend or ("", None)
        if extend is None or decisive not in changes:
            return super().configured(changes)
        decided = super().configured({decisive: changes[decisive]})
        params = extend(decided.params)
        more = replace(decided, type=replace(self.type, params=type(params)), params=params)
        return Member.configured(more, changes)

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
        there = [member.name for member in self.members]
        raise UsageError(f"no node {name!r} here{did_you_mean(name, there)}")

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

    def insert(
        self,
        added: NodeType,
        after: str,
        topics: Mapping[str, str] = MappingProxyType({}),
    ) -> Graph:
        """The same graph with one node more.

        Its inputs are the topics that are given; the first other of that type is the main output of
        ``after``; then those that are called as the input, or are the only ones of its type.
        The main output is the first of a type that the node takes, rather one that a node hears.
        Whoever listened to the main output listens to the new node's instead, if that has this one
        input, and an output of that type that is not made on demand.

        Args:
            added: the new node.
            after: the node that it comes after.
            topics: input -> topic, where it says. Where somebody publishes the topic of an output
                already, that is ``/NODE/OUTPUT``.

        Raises:
            UsageError: no such node or topic, the name is taken, or nothing fits an input.
        """
        before = self.node(after)
        if any(member.name == added.name for member in self.members):
            raise UsageError(f"there is a node {added.name!r} already; name yours differently")
        main, given = self._main_output(added, before)
        new = self._beside_others(place(added, self._inputs_of(added, main, given, topics)))
        makes = [
            topic
            for topic, made in new.topics.items()
            if made.type is given.type and not made.on_demand
        ]
        takes_over = makes and [new.inputs[port] for port in added.stepped] == [main]
        nodes = (
            [_rewired(node, main, makes[0]) for node in self.nodes] if takes_over else self.nodes
        )
        publishers = {after, *(self.topics[topic].publisher for topic in new.inputs.values())}
        last = max(n for n, member in enumerate(self.members) if member.name in publishers)
        begin = last + (self.source is None)
        return Graph(self.source, (*nodes[:begin], new, *nodes[begin:])).with_frames()

    def with_frames(self) -> Graph:
        """The same graph, with transforms for the nodes that need frames, if any are published."""

        def framed(node: Node) -> Node:
            known = TRANSFORMS if node.type.frames else {}
            there = {port: f"/{port}" for port in known if port not in node.inputs}
            there = {p: t for p, t in there.items() if self.source is None or t in self.topics}
            return replace(node, inputs={**node.inputs, **there})

        return Graph(self.source, tuple(framed(node) for node in self.nodes))

    def _beside_others(self, new: Node) -> Node:
        """The same node; what somebody publishes already is called after it."""
        outputs = {
            port: f"/{new.name}/{port}" if topic in self.topics else topic
            for port, topic in new.outputs.items()
        }
        return replace(new, outputs=outputs)

    def _main_output(self, added: NodeType, before: Member) -> tuple[str, TopicSpec]:
        """A topic of one node for the next: of a type that this takes, if there is any."""
        there = list(before.topics.items())
        if not there:
            raise UsageError(
                f"{added.name}: {before.name} publishes nothing; choose another @AFTER"
            )
        fitting = [(name, made) for name, made in there if made.type in added.stepped.values()]
        heard = {topic for node in self.nodes for topic in node.inputs.values()}
        return [*((name, made) for name, made in fitting if name in heard), *fitting, *there][0]

    def _inputs_of(
        self, added: NodeType, main: str, given: TopicSpec, topics: Mapping[str, str]
    ) -> dict[str, str]:
        """Input -> topic of a node that is to come after another, whose main output this is."""
        for port in topics.keys() - added.inputs.keys():
            raise UsageError(f"{added.name}: no input {port!r}{did_you_mean(port, added.inputs)}")
        found = dict(topics)
        free = [p for p, kind in added.stepped.items() if kind is given.type and p not in topics]
        found |= {port: main for port in free[:1]}
        for port, kind in added.inputs.items():
            fitting = [topic for topic, made in self.topics.items() if made.type is kind]
            named = [topic for topic in fitting if topic == f"/{port}"] or fitting
            if port in added.stepped and port not in found and len(named) == 1:
                found[port] = named[0]
            if (port in added.stepped or port in found) and found.get(port) not in fitting:
                hint = f"add ,{port}=TOPIC to its name, with TOPIC one of {', '.join(fitting)}"
                raise UsageError(
                    f"{added.name}: needs a topic of {kind.__name__} as {port};"
                    f" {hint if fitting else 'there is none here'}"
                )
        return found


def place(
    declared: NodeType, inputs: Mapping[str, str], outputs: Mapping[str, str] | None = None
) -> Node:
    """A node in a graph, with its own parameters.

    Args:
        declared: its type.
        inputs: input name -> topic.
        outputs: output name -> topic; else as the node declares it, else a single output is named
            after the node, and several keep their names.
    """
    single = len(declared.outputs) == 1
    named = {port: f"/{declared.name}" if single else f"/{port}" for port in declared.outputs}
    topics = outputs or {**named, **declared.topics}
    return Node(declared.name, declared, declared.params(), inputs, topics)


def place_source(declared: SourceType) -> SourceNode:
    """A source in a graph, on its usual topics, with its own parameters."""
    inputs = {port: f"/{port}" for port in declared.inputs}
    outputs = {port: SOURCE_TOPICS.get(port, f"/{port}") for port in declared.outputs}
    return SourceNode(declared.name, declared, declared.params(), inputs, outputs)


def _rewired(node: Node, before: str, now: str) -> Node:
    """A node that listens to another topic instead of one."""
    inputs = {port: now if topic == before else topic for port, topic in node.inputs.items()}
    return replace(node, inputs=inputs)
