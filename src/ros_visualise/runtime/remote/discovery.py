"""Who is on the graph: nodes whose messages can be shown, and nodes with live parameters."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from ros_visualise.data import (
    CompressedImage,
    DiagnosticArray,
    Image,
    ParameterEvent,
    Text,
)
from ros_visualise.data.logs import Log, Ros1Log
from ros_visualise.messages import data_class, type_name
from ros_visualise.runtime.bridge.namesakes import image_names
from ros_visualise.runtime.middleware import Listing

_COMPRESSED = type_name(CompressedImage)
_TOLD = {kind.type_name: kind for kind in (Log, Ros1Log, DiagnosticArray)}
_OF_THE_GRAPH = ("dynamic_reconfigure/", "rcl_interfaces/", "rosgraph_msgs/", "service_msgs/")
"""How types begin by which ROS itself works."""

_TOLD_AGAIN = "/rosout_agg"
_NOT_SHOWN = {DiagnosticArray, ParameterEvent, Text}


class Peer(NamedTuple):
    """A node of the graph: the topics that it publishes and takes, and where its parameters are."""

    name: str
    publishes: tuple[str, ...]
    takes: tuple[str, ...]
    parameters: tuple[str, ...]


class Sight(NamedTuple):
    """What there is at one moment.

    ``types``: the topics of messages that we have a class for, with that; ``told``: those on which
    nodes tell of themselves; ``compressed``: image topics that come compressed too; ``unknown``:
    topics of messages that cannot be shown, with their types.
    """

    peers: tuple[Peer, ...]
    types: Mapping[str, type]
    told: Mapping[str, type]
    compressed: frozenset[str]
    unknown: Mapping[str, str] = {}


def survey(listing: Listing, own: str) -> Sight:
    """What a graph's lists tell, without the nodes that only look on.

    Args:
        listing: all of the graph.
        own: full name of the node that looks: it sees the others in its namespace, and those above
            or below it, but not those of the robot next to it, nor itself.
    """
    kinds = listing.types.items()
    known = {topic: cls for topic, kind in kinds if (cls := data_class(kind)) and cls.on_topics}
    shown = {topic: cls for topic, cls in known.items() if cls not in _NOT_SHOWN}
    again = _again(shown, dict(listing.publishers))
    shown = {topic: cls for topic, cls in shown.items() if topic not in again}
    compressed = {t.rpartition("/")[0] for t, kind in kinds if kind == _COMPRESSED} & shown.keys()
    published = _pairs(listing.publishers)
    taken = [(_base(topic, compressed), node) for topic, node in _pairs(listing.subscribers)]
    taken = [(again.get(topic, topic), node) for topic, node in taken]
    there = {node for _, node in published + taken} | listing.parameters.keys()
    peers = []
    for name in sorted(name for name in there if _is_seen(name, own)):
        peer = Peer(
            name,
            tuple(topic for topic, node in published if node == name and topic in shown),
            tuple(topic for topic, node in taken if node == name and topic in shown),
            tuple(listing.parameters.get(name, ())),
        )
        if _matters(peer, shown, listing.onlookers):
            peers.append(peer)
    told = {name: _TOLD[kind] for name, kind in kinds if kind in _TOLD and name != _TOLD_AGAIN}
    near = {topic for topic, node in published if _is_seen(node, own)}
    unknown = {topic: kind for topic, kind in kinds if topic in near and _is_unsupported(kind)}
    return Sight(tuple(peers), shown, told, frozenset(compressed), unknown)


def _again(shown: Mapping[str, type], publishers: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """The topics on which nodes publish the images of another topic once more, with that."""
    found = {}
    for topic in [topic for topic, kind in shown.items() if kind is Image]:
        for again in image_names(topic)[1:]:
            if again in shown and publishers.get(again) == publishers.get(topic):
                found[again] = topic
    return found


def _pairs(ends: Iterable[tuple[str, Iterable[str]]]) -> list[tuple[str, str]]:
    return [(topic, node) for topic, nodes in sorted(ends) for node in nodes]


def _is_seen(node: str, own: str) -> bool:
    here, there = own.rpartition("/")[0] + "/", node.rpartition("/")[0] + "/"
    return node != own and (here.startswith(there) or there.startswith(here))


def _is_unsupported(kind: str) -> bool:
    return data_class(kind) in (None, Text) and not kind.startswith(_OF_THE_GRAPH)


def _base(topic: str, compressed: Collection[str]) -> str:
    """The images that somebody takes compressed."""
    base = topic.rpartition("/")[0]
    return base if topic.endswith("/compressed") and base in compressed else topic


def _matters(peer: Peer, shown: Mapping[str, type], onlookers: Collection[str]) -> bool:
    if any(shown[topic] is Image for topic in peer.publishes):
        return True
    does_something = bool(peer.publishes or peer.takes or peer.parameters)
    return does_something and peer.name not in onlookers
