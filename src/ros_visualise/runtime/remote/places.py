"""The nodes of a graph elsewhere -> a `Graph`, with a node for each place that has parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, NoReturn

from ros_visualise.core.params import Parameters
from ros_visualise.graph import Graph, Node
from ros_visualise.nodes import NodeType
from ros_visualise.runtime.remote.discovery import Peer
from ros_visualise.runtime.remote.figures import Figures
from ros_visualise.runtime.remote.parameters import RemoteParameters


class Place(NamedTuple):
    """What is shown as one node: a node, or one of several that share a process.

    ``path`` is its full name; ``has_parameters`` whether it has any there.
    """

    path: str
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    has_parameters: bool

    @property
    def name(self) -> str:
        """Its name on the page."""
        return self.path.removeprefix("/")


def places(peer: Peer, figures: Figures) -> list[Place]:
    """One place for a node, and one for each of those in it that have parameters of their own.

    Which of its topics belong to which, the nodes in it say themselves.
    """
    inner = [path for path in peer.parameters if path != peer.name]
    outputs = {path: [t for t in peer.publishes if t in figures.outputs(path)] for path in inner}
    inputs = {path: sorted(figures.inputs(path)) for path in inner}
    found = [Place(path, tuple(outputs[path]), tuple(inputs[path]), True) for path in inner]
    given = {topic for topics in outputs.values() for topic in topics}
    rest = tuple(topic for topic in peer.publishes if topic not in given)
    told = {topic for topics in inputs.values() for topic in topics}
    taken = tuple(topic for topic in peer.takes if topic not in told)
    has_own = peer.name in peer.parameters
    if rest or has_own or not inner:
        found.insert(0, Place(peer.name, rest, taken, has_own))
    return found


def to_graph(
    found: Iterable[Place], parameters: Mapping[str, Parameters[Any]], types: Mapping[str, type]
) -> Graph:
    """The graph of these places, in the order in which messages pass them."""
    nodes = (_node(place, parameters[place.name], types) for place in in_order(found))
    return Graph(None, tuple(nodes))


def in_order(found: Iterable[Place]) -> list[Place]:
    """Each place after those that it takes from; where they go round in a circle, by name."""
    waiting = sorted(found)
    ordered: list[Place] = []
    while waiting:
        coming = {topic for place in waiting for topic in place.outputs}
        ready = [place for place in waiting if not coming & set(place.inputs)] or waiting[:1]
        ordered += ready
        waiting = [place for place in waiting if place not in ready]
    return ordered


def _node(place: Place, parameters: Parameters[Any], types: Mapping[str, type]) -> Node:
    current = parameters.current
    ours = parameters.node if isinstance(parameters, RemoteParameters) else None
    on_demand = () if ours is None else ours.on_demand
    rare = {t for t in place.outputs if t.rpartition("/")[2] in on_demand}
    outputs = sorted(place.outputs, key=lambda topic: (topic in rare, topic))
    declared = NodeType(
        place.name,
        _made_elsewhere,
        type(current),
        {topic: types[topic] for topic in place.inputs if topic in types},
        {topic: types[topic] for topic in outputs if topic in types},
        frozenset(rare),
        actions={} if ours is None else ours.actions,
    )
    inputs = {topic: topic for topic in declared.inputs}
    return Node(place.name, declared, current, inputs, {topic: topic for topic in declared.outputs})


def _made_elsewhere(_: Any) -> NoReturn:
    raise AssertionError("runs in another process")
