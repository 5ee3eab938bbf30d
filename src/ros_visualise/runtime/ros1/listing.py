"""What the ROS master knows of the graph."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from http.client import HTTPException
from xmlrpc.client import Error as XmlRpcError

import rosgraph
import rospy

from ros_visualise.runtime.middleware import Listing

_IMAGE = "sensor_msgs/Image"
_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_SUFFIX = "/parameter_descriptions"
_ONLOOKERS = ("rosout", "rviz", "rqt", "record", "rostopic", "dynparam")
"""How the names of nodes begin that only look on."""


def look() -> Listing:
    """The graph without this node, and without those of other namespaces beside its own.

    Raises:
        ConnectionError: the master does not answer.
    """
    own = rospy.get_name()
    master = rosgraph.Master(own)
    try:
        publishers, subscribers, _ = master.getSystemState()
        types = master.getTopicTypes()
    except (OSError, HTTPException, XmlRpcError, rosgraph.MasterException) as error:
        raise ConnectionError(f"the ROS master does not answer: {error}") from error
    finally:
        master.handle("close")()
    return list_graph(publishers, subscribers, types, own)


def list_graph(
    publishers: Sequence[tuple[str, list[str]]],
    subscribers: Sequence[tuple[str, list[str]]],
    types: Sequence[tuple[str, str]],
    own: str,
) -> Listing:
    """What the master's lists tell: of topics and their nodes, and of topics and their types."""
    type_of = dict(types)
    parameters = defaultdict(list)
    publishers, subscribers = _seen_from(own, publishers), _seen_from(own, subscribers)
    for topic, nodes in sorted(publishers):
        if type_of.get(topic) != _DESCRIPTION or not topic.endswith(_SUFFIX):
            continue
        if _is_of_a_node(topic, type_of):
            for node in nodes:
                parameters[node].append(topic.removesuffix(_SUFFIX))
    seen = {node for _, nodes in (*publishers, *subscribers) for node in nodes}
    return Listing(
        publishers,
        subscribers,
        {topic: kind.replace("/", "/msg/") for topic, kind in types},
        parameters,
        {node for node in seen if node.rpartition("/")[2].startswith(_ONLOOKERS)},
    )


def _is_of_a_node(description: str, type_of: Mapping[str, str]) -> bool:
    """Whether parameters are a node's own, and not those of image_transport's plugins."""
    return type_of.get(description.removesuffix(_SUFFIX).rpartition("/")[0]) != _IMAGE


def _seen_from(own: str, ends: Sequence[tuple[str, list[str]]]) -> list[tuple[str, list[str]]]:
    """Topics with those of their nodes that a node sees: in its namespace, above or below it."""
    here = own.rpartition("/")[0] + "/"

    def is_seen(node: str) -> bool:
        there = node.rpartition("/")[0] + "/"
        return node != own and (here.startswith(there) or there.startswith(here))

    return [(topic, [node for node in nodes if is_seen(node)]) for topic, nodes in ends]
