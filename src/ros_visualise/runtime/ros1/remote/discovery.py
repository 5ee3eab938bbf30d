"""Who is on the ROS graph: nodes that publish or take images, and nodes with live parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import rosgraph
import rospy

_IMAGE = "sensor_msgs/Image"
_COMPRESSED = "sensor_msgs/CompressedImage"
_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_SUFFIX = "/parameter_descriptions"
_ASIDE = ("rosout", "rviz", "rqt", "record", "rostopic", "dynparam")
"""How the names of nodes begin that only look on."""


class Peer(NamedTuple):
    """A node of the graph: the images that it publishes and takes, and where its parameters are."""

    name: str
    publishes: tuple[str, ...]
    takes: tuple[str, ...]
    reconfigure: tuple[str, ...]


class Sight(NamedTuple):
    """What there is at one moment; ``compressed``: image topics that come compressed too."""

    peers: tuple[Peer, ...]
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
    published = [(topic, node) for topic, nodes in sorted(publishers) for node in nodes]
    taken = [(topic, node) for topic, nodes in sorted(subscribers) for node in nodes]
    images = {topic for topic, kind in type_of.items() if kind == _IMAGE}
    peers = []
    for name in sorted({node for _, node in published + taken} - {own}):
        topics = [topic for topic, node in published if node == name]
        peer = Peer(
            name,
            tuple(topic for topic in topics if topic in images),
            tuple(topic for topic, node in taken if node == name and topic in images),
            tuple(_namespaces([t for t in topics if type_of.get(t) == _DESCRIPTION], images)),
        )
        if _matters(peer):
            peers.append(peer)
    compressed = {t.rpartition("/")[0] for t, _ in published if type_of.get(t) == _COMPRESSED}
    return Sight(tuple(peers), frozenset(compressed))


def _namespaces(descriptions: Sequence[str], images: set[str]) -> list[str]:
    """Where a node has parameters; those of image_transport's plugins are not its own."""
    found = [topic.removesuffix(_SUFFIX) for topic in descriptions if topic.endswith(_SUFFIX)]
    return [name for name in found if name.rpartition("/")[0] not in images]


def _matters(peer: Peer) -> bool:
    if peer.publishes:
        return True
    aside = peer.name.rpartition("/")[2].startswith(_ASIDE)
    return not aside and bool(peer.takes or peer.reconfigure)
