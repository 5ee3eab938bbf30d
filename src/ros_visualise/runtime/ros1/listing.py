"""What the ROS master knows of the graph."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from xmlrpc.client import ServerProxy

import rosgraph
import rospy

from ros_visualise.runtime.middleware import Listing
from ros_visualise.runtime.ros1.errors import asking
from ros_visualise.runtime.ros1.registration import BoundedTransport

_IMAGE = "sensor_msgs/Image"
_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_SUFFIX = "/parameter_descriptions"
_ONLOOKERS = ("rosout", "rviz", "rqt", "record", "rostopic", "dynparam")
"""How the names of nodes begin that only look on."""


def look() -> Listing:
    """The graph as the master has it.

    Raises:
        Unreachable: the master does not answer.
    """
    master = rosgraph.Master(rospy.get_name())
    with asking("the ROS master"), ServerProxy(master.master_uri, BoundedTransport()) as proxy:
        master.handle = proxy  # its own waits for ever
        publishers, subscribers, _ = master.getSystemState()
        types = master.getTopicTypes()
    return list_graph(publishers, subscribers, types)


def list_graph(
    publishers: Sequence[tuple[str, list[str]]],
    subscribers: Sequence[tuple[str, list[str]]],
    types: Sequence[tuple[str, str]],
) -> Listing:
    """What the master's lists tell: of topics and their nodes, and of topics and their types."""
    type_of = dict(types)
    parameters = defaultdict(list)
    for topic, nodes in sorted(publishers):
        if type_of.get(topic) != _DESCRIPTION or not topic.endswith(_SUFFIX):
            continue
        if _is_of_a_node(topic, type_of):
            for node in nodes:
                parameters[node].append(topic.removesuffix(_SUFFIX))
    there = {node for _, nodes in (*publishers, *subscribers) for node in nodes}
    return Listing(
        publishers,
        subscribers,
        {topic: kind.replace("/", "/msg/") for topic, kind in types},
        parameters,
        {node for node in there if node.rpartition("/")[2].startswith(_ONLOOKERS)},
    )


def _is_of_a_node(description: str, type_of: Mapping[str, str]) -> bool:
    """Whether parameters are a node's own, and not those of image_transport's plugins."""
    return type_of.get(description.removesuffix(_SUFFIX).rpartition("/")[0]) != _IMAGE
