"""ROS 2 as a transport; see `ros_visualise.runtime.middleware.Transport`."""

from __future__ import annotations

import logging
from collections import defaultdict
from collections.abc import Callable
from functools import cached_property
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.data import CameraInfo
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Listing, ParametersListener, Transport
from ros_visualise.runtime.ros2 import clock, publishers, services, session
from ros_visualise.runtime.ros2.errors import translated
from ros_visualise.runtime.ros2.parameters import ParameterDesk, Ros2ServedParameters
from ros_visualise.runtime.ros2.parameters_client import ParameterClient, ParameterEvents
from ros_visualise.runtime.ros2.publishers import Ros2Publisher, Unsent
from ros_visualise.runtime.ros2.quality import clash
from ros_visualise.runtime.ros2.services import Ros2Service
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.subscriptions import Ros2Subscriber

log = logging.getLogger(__name__)

_ONLOOKERS = ("_", "rviz", "rqt", "rosbag2", "launch_ros", "transform_listener_impl")
"""Beginnings of the names of nodes that only look on; those of hidden ones with ``_``."""

_DESCRIBE = "rcl_interfaces/srv/DescribeParameters"


class Look:
    """Looks at the graph, and says which of its nodes cannot hear each other.

    Args:
        node: of this process.
        parameters: finds the places of nodes' parameters.
    """

    def __init__(self, node: Node, parameters: ParameterEvents) -> None:
        self._node = node
        self._parameters = parameters
        self._compared: dict[str, tuple[frozenset[str], frozenset[str]]] = {}
        self._said: set[str] = set()

    def __call__(self) -> Listing:
        """The graph as far as it is known."""
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
        """Say which subscribers get nothing, once, when a topic has another end."""
        for topic in publishers.keys() & subscribers.keys():
            ends = frozenset(publishers[topic]), frozenset(subscribers[topic])
            if self._compared.get(topic) != ends:
                self._compared[topic] = ends
                self._report_clashes(topic)

    def _report_clashes(self, topic: str) -> None:
        takers = self._node.get_subscriptions_info_by_topic(topic)
        for one in self._node.get_publishers_info_by_topic(topic):
            for other in takers:
                why = clash(one, other)
                if why is not None and f"{topic}{why}" not in self._said:
                    self._said.add(f"{topic}{why}")
                    log.warning("%s: incompatible QoS: %s", topic, why)


class Ros2Transport(Transport):
    """The topics and services of a node.

    Args:
        session: the node.

    Attributes:
        session: the node.
        desk: answers for its parameters.
    """

    def __init__(self, session: Ros2Session) -> None:
        self.session = session
        self.desk = ParameterDesk(session)

    def close(self) -> None:
        self.session.end()

    def resolve(self, name: str) -> str:
        return self.session.resolve(name)

    @translated("the ROS 2 graph")
    def advertise(self, topic: str, type: TopicType) -> Ros2Publisher | Unsent:
        return self.session.keep(publishers.advertise(self.session, topic, type))

    @translated("the ROS 2 graph")
    def subscribe(
        self, topic: str, kind: type, take: Callable[[Any], None], reject: Callable[[str], None]
    ) -> Ros2Subscriber:
        return self.session.keep(Ros2Subscriber(self.session, topic, kind, take, reject))

    @translated("the ROS 2 graph")
    def offer(self, action: str, act: Callable[[], str | None]) -> Ros2Service:
        return services.trigger(self.session.node, session.spelled(action), act)

    @translated("the ROS 2 graph")
    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Ros2Service:
        return services.set_camera_info(self.session.node, session.spelled(service), take)

    def call(self, action: str) -> None:
        with translated(action):
            services.call(self.session.node, action)

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> Ros2ServedParameters:
        return self.desk.serve(parameters, namespace)

    def follow_parameters(self, node: str, listener: ParametersListener) -> ParameterClient:
        name, prefix = self._events.where(node)
        return self.session.keep(ParameterClient(self._events, name, prefix, listener))

    @translated("the ROS 2 graph")
    def listing(self) -> Listing:
        return self._look()

    def clock(self) -> Clock:
        return clock.ros_clock(self.session.node)

    @cached_property
    def _events(self) -> ParameterEvents:
        return ParameterEvents(self.session)

    @cached_property
    def _look(self) -> Look:
        return Look(self.session.node, self._events)
