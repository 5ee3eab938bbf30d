"""Graphs of nodes: what runs, and the topics that connect it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol, TypeVar

from ros_visualise.core import params
from ros_visualise.core.declarations import TRANSFORMS, declaration_of
from ros_visualise.core.errors import ParameterError, UsageError, did_you_mean
from ros_visualise.core.message import Message
from ros_visualise.data import Image
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
    "estimate": "/navigation/pose",
}
"""Output or input of a source -> its topic, where that is not named after it."""

IMAGE_NODES = ("fps_control", "filters", "edge_detector")
"""The nodes that images pass in the pipelines, in order."""


@dataclass(frozen=True)
class TopicSpec:
    """A topic: the class of its messages, its publisher, and if it publishes on demand only.

    ``ros`` is its type on a ROS graph and in recordings, with its quality of service.
    """

    type: type[Message]
    publisher: str
    on_demand: bool
    ros: TopicType


@dataclass(frozen=True)
class Member:
    """A node or a source in a graph: its name there, its type, its parameters, its topics.

    ``inputs`` and ``outputs`` map the names in its declaration to topics. ``aside``: another member
    shows the same picture, so that a page begins without a window for this one.
    """

    name: str
    type: NodeType | SourceType
    params: Any
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    aside: bool = False

    @property
    def topics(self) -> dict[str, TopicSpec]:
        """Published topics, by name."""
        return {topic: self._topic(port) for port, topic in self.outputs.items()}

    def topics_of(self, kind: Any) -> list[str]:
        """Published topics of messages of this class."""
        return [topic for port, topic in self.outputs.items() if self.type.outputs[port] is kind]

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
        ros = TopicType(cls.type_name, qos=qos)
        return TopicSpec(cls, self.name, port in self.type.on_demand, ros)


@dataclass(frozen=True)
class Node(Member):
    """A node in a graph."""

    type: NodeType


@dataclass(frozen=True)
class SourceNode(Member):
    """The source of a graph."""

    type: SourceType

    def configured(self, changes: Mapping[str, Any]) -> SourceNode:
        """The same with other starting parameters; one of them may bring further ones."""
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
    """Changes a node or a source."""

    def __call__(self, member: M, /) -> M:
        """The member in its place."""


@dataclass(frozen=True)
class Graph:
    """A source, and nodes in the order in which messages pass them.

    Where messages come from outside, ``source`` is None.
    """

    source: SourceNode | None
    nodes: tuple[Node, ...]

    @property
    def members(self) -> tuple[Member, ...]:
        """The source, if any, and the nodes."""
        return (*(() if self.source is None else (self.source,)), *self.nodes)

    @property
    def live(self) -> bool:
        """True if its source cannot wait for slow nodes."""
        return self.source is None or self.source.type.live

    @property
    def makes_time(self) -> bool:
        """True if its source sets the time."""
        return self.source is not None and self.source.type.makes_time

    @property
    def inputs(self) -> dict[str, type[Message]]:
        """Topics published elsewhere, and the type of their messages."""
        return {
            topic: node.type.inputs[port]
            for node in self.members
            for port, topic in node.inputs.items()
            if topic not in self.topics
        }

    @cached_property
    def topics(self) -> Mapping[str, TopicSpec]:
        """Every topic by name, in the order of the nodes."""
        return {name: topic for one in self.members for name, topic in one.topics.items()}

    def topics_of(self, kind: type, *names: str) -> list[str]:
        """Topics of messages of this class, from all members or from those of these names."""
        members = [one for one in self.members if not names or one.name in names]
        return [topic for one in members for topic in one.topics_of(kind)]

    def node(self, name: str) -> Member:
        """The node or the source of that name.

        Raises:
            UsageError: unknown name; the known ones are listed.
        """
        for member in self.members:
            if member.name == name:
                return member
        names = [member.name for member in self.members]
        raise UsageError(f"no node {name!r}{did_you_mean(name, names)}")

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

    def joined(self, *nodes: Node) -> Graph:
        """The same graph with more nodes at its end."""
        return replace(self, nodes=(*self.nodes, *nodes))._with_frames()

    def chained(self, added: Sequence[NodeType], topic: str = "/image_raw") -> Graph:
        """The same graph with nodes that images of a topic pass, one after the other.

        Raises:
            UsageError: two of the same name, or one whose input is not what comes before it.
        """
        graph, given = self, Image
        for declared in added:
            if any(node.name == declared.name for node in graph.nodes):
                raise UsageError(f"{declared.name}: duplicate node")
            if list(declared.stepped.values()) != [given]:
                raise UsageError(f"{declared.name}: needs one input of type {given.__name__}")
            node = place(declared, {next(iter(declared.stepped)): topic})
            graph = graph.joined(node)
            passed = [port for port, kind in declared.outputs.items() if kind is given]
            topic = next((node.outputs[p] for p in passed if p not in declared.on_demand), topic)
        return graph._with_one_picture()

    def insert(
        self,
        added: NodeType | Callable[..., Any],
        after: str,
        topics: Mapping[str, str] = MappingProxyType({}),
    ) -> Graph:
        """The same graph with a node among the others.

        Its inputs are the given topics; the first other input of that type takes the main output
        of ``after``; the others take topics of their own name, the only one of their type, or what
        ``after`` takes. An input that may be missing stays open where no topic fits, or another
        input has one of its type. The main output is of the first type that the node takes,
        preferably one with a subscriber.
        If the node has this one input, and an output of that type that is not on demand, the
        subscribers of the main output subscribe to that instead.

        Args:
            added: the new node, or a function or class that was decorated as one.
            after: the node that it comes after.
            topics: input -> topic. An output whose topic is taken publishes on ``/NODE/OUTPUT``.

        Raises:
            UsageError: no such node or topic, the name is taken, or nothing fits an input.
        """
        added = declaration_of(added)
        before = self.node(after)
        if any(member.name == added.name for member in self.members):
            raise UsageError(f"a node {added.name!r} already exists; choose another name")
        main, given = self._main_output(added, before)
        new = self._beside_others(place(added, self._inputs_of(added, before, main, given, topics)))
        makes = [
            topic
            for topic, made in new.topics.items()
            if made.type is given.type and not made.on_demand
        ]
        takes_over = makes and [new.inputs.get(port) for port in added.stepped] == [main]
        nodes = (
            [_rewired(node, main, makes[0]) for node in self.nodes] if takes_over else self.nodes
        )
        publishers = {after, *(self.topics[topic].publisher for topic in new.inputs.values())}
        last = max(n for n, member in enumerate(self.members) if member.name in publishers)
        begin = last + (self.source is None)
        return Graph(self.source, (*nodes[:begin], new, *nodes[begin:]))._with_frames()

    def _with_frames(self) -> Graph:
        """The same graph, with transforms for the nodes that need frames, if any are published.

        Those that a node's step takes are given as any other input; without them it gets none.
        """
        published = {
            port: f"/{port}"
            for port in TRANSFORMS
            if self.source is None or f"/{port}" in self.topics
        }

        def framed(node: Node) -> Node:
            stepped = TRANSFORMS.keys() & node.type.stepped.keys()
            needs = node.type.frames and stepped <= node.inputs.keys()
            return replace(node, inputs={**published, **node.inputs}) if needs else node

        return replace(self, nodes=tuple(framed(node) for node in self.nodes))

    def _with_one_picture(self) -> Graph:
        """The same graph; of a source and a node that show one picture, one is put aside.

        That is the one with less to set.
        """
        passing = next((node for node in self.nodes if node.name == IMAGE_NODES[0]), None)
        source = self.source
        if source is None or passing is None or not {*passing.inputs.values()} & {*source.topics}:
            return self
        images = [kind for kind in source.type.outputs.values() if kind is Image]
        live = [spec for spec in params.specs(source.params) if not spec.restart]
        if live or source.type.actions or len(images) > 1:
            nodes = (replace(one, aside=one is passing or one.aside) for one in self.nodes)
            return replace(self, nodes=tuple(nodes))
        return replace(self, source=replace(source, aside=True))

    def _beside_others(self, new: Node) -> Node:
        """The same node; an output whose topic is taken is named after the node too."""
        outputs = {
            port: f"/{new.name}/{port}" if topic in self.topics else topic
            for port, topic in new.outputs.items()
        }
        return replace(new, outputs=outputs)

    def _main_output(self, added: NodeType, before: Member) -> tuple[str, TopicSpec]:
        """The topic of one node that the next takes: of a fitting type, if any."""
        there = list(before.topics.items())
        if not there:
            raise UsageError(
                f"{added.name}: {before.name} publishes nothing; choose another @AFTER"
            )
        kinds = list(added.stepped.values())
        fitting = [(name, made) for name, made in there if made.type in kinds]
        fitting.sort(key=lambda one: kinds.index(one[1].type))
        heard = {topic for node in self.nodes for topic in node.inputs.values()}
        first = [one for one in fitting if one[1].type is fitting[0][1].type]
        return [*((name, made) for name, made in first if name in heard), *fitting, *there][0]

    def _inputs_of(
        self,
        added: NodeType,
        before: Member,
        main: str,
        given: TopicSpec,
        topics: Mapping[str, str],
    ) -> dict[str, str]:
        """Input -> topic of a node after another with this main output."""
        for port in topics.keys() - added.inputs.keys():
            raise UsageError(f"{added.name}: no input {port!r}{did_you_mean(port, added.inputs)}")
        found = dict(topics)
        free = [p for p, kind in added.stepped.items() if kind is given.type and p not in topics]
        found |= {port: main for port in free[:1]}
        open_ports = [port for port in added.stepped if port not in found]
        found |= {p: f"/{p}" for p in open_ports if f"/{p}" in self.topics_of(added.inputs[p])}
        for port, kind in added.inputs.items():
            fitting = self.topics_of(kind)
            free = [topic for topic in fitting if topic not in found.values()]
            near = [topic for topic in before.inputs.values() if topic in free]
            if port in added.stepped and port not in found and 1 in (len(free), len(near)):
                found[port] = free[0] if len(free) == 1 else near[0]
            has_one = kind in (added.inputs[one] for one in found)
            if port in added.optional and port not in found and (has_one or not free):
                continue
            if (port in added.stepped or port in found) and found.get(port) not in fitting:
                hint = f"add ,{port}=TOPIC to its name, with TOPIC one of {', '.join(fitting)}"
                raise UsageError(
                    f"{added.name}: needs a topic of type {kind.__name__} for its input {port};"
                    f" {hint if fitting else 'none is published'}"
                )
        return found


def place(
    declared: NodeType, inputs: Mapping[str, str], outputs: Mapping[str, str] | None = None
) -> Node:
    """A node in a graph, with its own parameters.

    Args:
        declared: its type.
        inputs: input name -> topic.
        outputs: output name -> topic; without, as declared; else a single output is named after
            the node, and several keep their names.
    """
    single = len(declared.outputs) == 1
    named = {port: f"/{declared.name}" if single else f"/{port}" for port in declared.outputs}
    topics = outputs or {**named, **declared.topics}
    return Node(declared.name, declared, declared.params(), inputs, topics)


def place_source(
    declared: SourceType, outputs: Mapping[str, str] = MappingProxyType({})
) -> SourceNode:
    """A source in a graph, with its own parameters, on its usual topics but for those given."""
    inputs = {port: SOURCE_TOPICS.get(port, f"/{port}") for port in declared.inputs}
    usual = {port: SOURCE_TOPICS.get(port, f"/{port}") for port in declared.outputs}
    return SourceNode(declared.name, declared, declared.params(), inputs, {**usual, **outputs})


def _rewired(node: Node, before: str, now: str) -> Node:
    """A node that subscribes to ``now`` instead of ``before``."""
    inputs = {port: now if topic == before else topic for port, topic in node.inputs.items()}
    return replace(node, inputs=inputs)
