"""What is known here of the ROS 2 graph."""

from __future__ import annotations

import logging
from collections import defaultdict

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ros_visualise.runtime.middleware import Listing
from ros_visualise.runtime.ros2.parameters_client import ParameterEvents
from ros_visualise.runtime.ros2.quality import clash

log = logging.getLogger(__name__)

_ONLOOKERS = ("_", "rviz", "rqt", "rosbag2", "launch_ros", "transform_listener_impl")
"""How the names of nodes begin that only look on; those of hidden ones with ``_``."""

_DESCRIBE = "rcl_interfaces/srv/DescribeParameters"


class Look:
    """Looks at the graph, and says which of its nodes cannot hear each other.

    Args:
        node: of this process.
        parameters: knows where nodes have theirs.
    """

    def __init__(self, node: Node, parameters: ParameterEvents) -> None:
        self._node = node
        self._parameters = parameters
        self._compared: dict[str, tuple[frozenset[str], frozenset[str]]] = {}
        self._said: set[str] = set()

    def __call__(self) -> Listing:
        """The graph as other nodes have told of themselves by now."""
        publishers: dict[str, list[str]] = defaultdict(list)
        subscribers: dict[str, list[str]] = defaultdict(list)
        types: dict[str, str] = {}
        parameters: dict[str, tuple[str, ...]] = {}
        there = set()
        for name, namespace in set(self._node.get_node_names_and_namespaces()):
            full = f"{namespace.rstrip('/')}/{name}"
            there.add(full)
            try:
                sent = self._node.get_publisher_names_and_types_by_node(name, namespace)
                taken = self._node.get_subscriber_names_and_types_by_node(name, namespace)
                services = self._node.get_service_names_and_types_by_node(name, namespace)
            except rclpy_implementation.NodeNameNonExistentError:  # it has gone meanwhile
                continue
            for ends, lists in ((sent, publishers), (taken, subscribers)):
                for topic, kinds in ends:
                    lists[topic].append(full)
                    types.setdefault(topic, kinds[0])
            if any(_DESCRIBE in kinds for _, kinds in services):
                parameters[full] = self._parameters.places(full)
        self._parameters.forget(there)
        self._compare(publishers, subscribers)
        return Listing(
            list(publishers.items()),
            list(subscribers.items()),
            types,
            {node: places for node, places in parameters.items() if places},
            {node for node in there if node.rpartition("/")[2].startswith(_ONLOOKERS)},
        )

    def _compare(self, publishers: dict[str, list[str]], subscribers: dict[str, list[str]]) -> None:
        """Say which subscribers get nothing, once, where somebody has come to a topic."""
        for topic in publishers.keys() & subscribers.keys():
            ends = frozenset(publishers[topic]), frozenset(subscribers[topic])
            if self._compared.get(topic) != ends:
                self._compared[topic] = ends
                self._say_clashes(topic)

    def _say_clashes(self, topic: str) -> None:
        takers = self._node.get_subscriptions_info_by_topic(topic)
        for one in self._node.get_publishers_info_by_topic(topic):
            for other in takers:
                why = clash(one, other)
                if why is not None and f"{topic}{why}" not in self._said:
                    self._said.add(f"{topic}{why}")
                    log.warning("%s: no messages pass: %s", topic, why)
