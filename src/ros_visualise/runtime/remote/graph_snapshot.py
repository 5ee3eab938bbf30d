"""A remote graph at one moment: its nodes with their topics and live parameters, and its images."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, NoReturn

from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters
from ros_visualise.data import CompressedImage, DiagnosticArray, Image, ParameterEvent
from ros_visualise.data.reports import Log, Ros1Log
from ros_visualise.graph import Graph, Node
from ros_visualise.messages import data_class
from ros_visualise.nodes import NodeType
from ros_visualise.runtime.bridge.aliases import image_names
from ros_visualise.runtime.diagnostics import DiagnosticsReader
from ros_visualise.runtime.middleware import Listing
from ros_visualise.runtime.remote.parameters import RemoteParameters

_COMPRESSED = CompressedImage.type_name
_DIAGNOSTIC = {kind.type_name: kind for kind in (Log, Ros1Log, DiagnosticArray)}
_OF_THE_GRAPH = ("dynamic_reconfigure/", "rcl_interfaces/", "rosgraph_msgs/", "service_msgs/")
"""Prefixes of the types by which ROS itself works."""

_REPEATED_LOG = "/rosout_agg"
_NOT_SHOWN = {DiagnosticArray, ParameterEvent}


class RemoteNode(NamedTuple):
    """A remote node: its full name, the topics that it publishes and takes, its parameters.

    ``parameters`` are the names under which it has live parameters: its own, and those of the nodes
    that share its process.
    """

    path: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its name on the page."""
        return self.path.removeprefix("/")

    def split(self, reports: DiagnosticsReader) -> list[RemoteNode]:
        """The node, and one for each other in its process that has parameters of its own.

        Which topics belong to which of them is known from their diagnostics.
        """
        found: list[RemoteNode] = []
        for path in self.parameters:
            if path != self.path:
                report = reports.report(path, stale=True)
                outputs = tuple(topic for topic in self.outputs if topic in report.outputs)
                inputs = tuple(sorted(set(report.inputs.values())))
                found.append(RemoteNode(path, outputs, inputs, (path,)))
        published = {topic for one in found for topic in one.outputs}
        taken = {topic for one in found for topic in one.inputs}
        outputs = tuple(topic for topic in self.outputs if topic not in published)
        inputs = tuple(topic for topic in self.inputs if topic not in taken)
        own = tuple(path for path in self.parameters if path == self.path)
        if outputs or own or not found:
            found.insert(0, RemoteNode(self.path, outputs, inputs, own))
        return found


class GraphSnapshot(NamedTuple):
    """The nodes and topics of a graph at one moment.

    ``types``: topics with supported messages -> class; ``diagnostics``: topics of logs and
    diagnostics -> class; ``compressed``: image topics that are also published compressed;
    ``unknown``: topics with unsupported messages -> type.
    """

    nodes: tuple[RemoteNode, ...] = ()
    types: Mapping[str, type] = {}
    diagnostics: Mapping[str, type[Message]] = {}
    compressed: frozenset[str] = frozenset()
    unknown: Mapping[str, str] = {}


def snapshot(listing: Listing, own: str) -> GraphSnapshot:
    """A snapshot of a graph, without the nodes that only look on.

    Args:
        listing: all of the graph.
        own: full name of the node that looks. It sees nodes in its namespace and in those above and
            below it, but not those of the robot next to it, nor itself.
    """
    kinds = listing.types.items()
    known = {topic: cls for topic, kind in kinds if (cls := data_class(kind)) and cls.on_topics}
    shown = {topic: cls for topic, cls in known.items() if cls not in _NOT_SHOWN}
    aliases = _aliases(shown, dict(listing.publishers))
    shown = {topic: cls for topic, cls in shown.items() if topic not in aliases}
    compressed = {t.rpartition("/")[0] for t, kind in kinds if kind == _COMPRESSED} & shown.keys()
    published = _pairs(listing.publishers)
    taken = [
        (_uncompressed(topic, compressed), node) for topic, node in _pairs(listing.subscribers)
    ]
    taken = [(aliases.get(topic, topic), node) for topic, node in taken]
    there = {node for _, node in published + taken} | listing.parameters.keys()
    nodes = [
        RemoteNode(
            name,
            tuple(topic for topic, node in published if node == name and topic in shown),
            tuple(topic for topic, node in taken if node == name and topic in shown),
            tuple(listing.parameters.get(name, ())),
        )
        for name in sorted(name for name in there if _is_visible(name, own))
    ]
    diagnostics = {
        topic: _DIAGNOSTIC[kind]
        for topic, kind in kinds
        if kind in _DIAGNOSTIC and topic != _REPEATED_LOG
    }
    near = {topic for topic, node in published if _is_visible(node, own)}
    unknown = {topic: kind for topic, kind in kinds if topic in near and _is_unsupported(kind)}
    used = tuple(node for node in nodes if _is_used(node, shown, listing.onlookers))
    return GraphSnapshot(used, shown, diagnostics, frozenset(compressed), unknown)


def to_graph(
    nodes: Iterable[RemoteNode],
    parameters: Mapping[str, Parameters[Any]],
    types: Mapping[str, type],
) -> Graph:
    """The graph of these nodes, in the order in which messages pass them."""
    members = (_member(node, parameters[node.name], types) for node in in_order(nodes))
    return Graph(None, tuple(members))


def in_order(nodes: Iterable[RemoteNode]) -> list[RemoteNode]:
    """Each node after those whose topics it takes; in a cycle, by name."""
    waiting = sorted(nodes)
    ordered: list[RemoteNode] = []
    while waiting:
        coming = {topic for node in waiting for topic in node.outputs}
        ready = [node for node in waiting if not coming & set(node.inputs)] or waiting[:1]
        ordered += ready
        waiting = [node for node in waiting if node not in ready]
    return ordered


def _member(node: RemoteNode, parameters: Parameters[Any], types: Mapping[str, type]) -> Node:
    current = parameters.current
    ours = parameters.node if isinstance(parameters, RemoteParameters) else None
    on_demand = () if ours is None else ours.on_demand
    rare = {t for t in node.outputs if t.rpartition("/")[2] in on_demand}
    outputs = sorted(node.outputs, key=lambda topic: (topic in rare, topic))
    declared = NodeType(
        node.name,
        _made_elsewhere,
        type(current),
        {topic: types[topic] for topic in node.inputs if topic in types},
        {topic: types[topic] for topic in outputs if topic in types},
        frozenset(rare),
        actions={} if ours is None else ours.actions,
    )
    inputs, made = ({t: t for t in ports} for ports in (declared.inputs, declared.outputs))
    return Node(node.name, declared, current, inputs, made)


def _made_elsewhere(_: Any) -> NoReturn:
    raise AssertionError("runs in another process")


def _aliases(shown: Mapping[str, type], publishers: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Topics that repeat the images of another topic, with that topic."""
    found = {}
    for topic in [topic for topic, kind in shown.items() if kind is Image]:
        for alias in image_names(topic)[1:]:
            if alias in shown and publishers.get(alias) == publishers.get(topic):
                found[alias] = topic
    return found


def _pairs(ends: Iterable[tuple[str, Iterable[str]]]) -> list[tuple[str, str]]:
    return [(topic, node) for topic, nodes in sorted(ends) for node in nodes]


def _is_visible(node: str, own: str) -> bool:
    here, there = own.rpartition("/")[0] + "/", node.rpartition("/")[0] + "/"
    return node != own and (here.startswith(there) or there.startswith(here))


def _is_unsupported(kind: str) -> bool:
    return data_class(kind) is None and not kind.startswith(_OF_THE_GRAPH)


def _uncompressed(topic: str, compressed: Collection[str]) -> str:
    """The topic of the raw images, of one of compressed images."""
    base = topic.rpartition("/")[0]
    return base if topic.endswith("/compressed") and base in compressed else topic


def _is_used(node: RemoteNode, shown: Mapping[str, type], onlookers: Collection[str]) -> bool:
    if any(shown[topic] is Image for topic in node.outputs):
        return True
    return bool(node.outputs or node.inputs or node.parameters) and node.path not in onlookers
