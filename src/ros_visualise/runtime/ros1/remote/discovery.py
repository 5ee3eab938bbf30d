"""Who is on the ROS graph: nodes whose messages can be shown, and nodes with live parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import rosgraph
import rospy

from ros_visualise.data import MESSAGES, Image, ParameterEvent, Text
from ros_visualise.messages import data_class

_COMPRESSED = "sensor_msgs/CompressedImage"
_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_SUFFIX = "/parameter_descriptions"
_SHOWN = set(MESSAGES) - {ParameterEvent, Text}
_ASIDE = ("rosout", "rviz", "rqt", "record", "rostopic", "dynparam")
"""How the names of nodes begin that only look on."""


class Peer(NamedTuple):
    """A node of the graph: the topics that it publishes and takes, and where its parameters are."""

    name: str
    publishes: tuple[str, ...]
    takes: tuple[str, ...]
    reconfigure: tuple[str, ...]


class Sight(NamedTuple):
    """What there is at one moment.

    ``types``: the topics of messages that we have a class for, with that; ``compressed``: image
    topics that come compressed too.
    """

    peers: tuple[Peer, ...]
    types: Mapping[str, type]
    compressed: frozenset[str]


class Discovery:
    """Asks the ROS master who is there; for one thread."""

    def __init__(self) -> None:
        self._own = rospy.get_name()
        self._master = rosgraph.Master(self._own)

    def look(self) -> Sight:
        """Who is there now, without this node and those that only look on.

        Raises:
            OSError, rosgraph.MasterException: the master does not answer.
        """
        publishers, subscribers, _ = self._master.getSystemState()
        return survey(publishers, subscribers, self._master.getTopicTypes(), self._own)

    def close(self) -> None:
        """Ask no more."""
        self._master.handle("close")()


def survey(
    publishers: Sequence[tuple[str, list[str]]],
    subscribers: Sequence[tuple[str, list[str]]],
    types: Sequence[tuple[str, str]],
    own: str,
) -> Sight:
    """What the master's lists tell: topic -> its nodes, and topic -> its type."""
    type_of = dict(types)
    shown = {topic: cls for topic, kind in types if (cls := _class_of(kind))}
    compressed = {t.rpartition("/")[0] for t, kind in types if kind == _COMPRESSED} & shown.keys()
    published = [(topic, node) for topic, nodes in sorted(publishers) for node in nodes]
    taken = [(_base(t, compressed), node) for t, nodes in sorted(subscribers) for node in nodes]
    peers = []
    for name in sorted({node for _, node in published + taken} - {own}):
        topics = [topic for topic, node in published if node == name]
        described = [topic for topic in topics if type_of.get(topic) == _DESCRIPTION]
        peer = Peer(
            name,
            tuple(topic for topic in topics if topic in shown),
            tuple(topic for topic, node in taken if node == name and topic in shown),
            tuple(_namespaces(described, shown)),
        )
        if _matters(peer, shown):
            peers.append(peer)
    return Sight(tuple(peers), shown, frozenset(compressed))


def _class_of(kind: str) -> type | None:
    """Our class for what can be shown of a ROS 1 type."""
    found = data_class(kind.replace("/", "/msg/"))
    return found if found in _SHOWN else None


def _base(topic: str, compressed: Collection[str]) -> str:
    """The images that somebody takes compressed."""
    base = topic.rpartition("/")[0]
    return base if topic.endswith("/compressed") and base in compressed else topic


def _namespaces(descriptions: Sequence[str], images: Collection[str]) -> list[str]:
    """Where a node has parameters; those of image_transport's plugins are not its own."""
    found = [topic.removesuffix(_SUFFIX) for topic in descriptions if topic.endswith(_SUFFIX)]
    return [name for name in found if name.rpartition("/")[0] not in images]


def _matters(peer: Peer, shown: Mapping[str, type]) -> bool:
    if any(shown[topic] is Image for topic in peer.publishes):
        return True
    aside = peer.name.rpartition("/")[2].startswith(_ASIDE)
    return not aside and bool(peer.publishes or peer.takes or peer.reconfigure)
