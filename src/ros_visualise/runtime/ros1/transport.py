"""ROS 1 as a transport; see `ros_visualise.runtime.middleware.Transport`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import rospy

from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters
from ros_visualise.core.rate import Clock
from ros_visualise.core.supervision import attempt
from ros_visualise.data import CameraInfo, Text
from ros_visualise.messages import from_message
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import (
    Handle,
    Listing,
    ParametersListener,
    Subscriber,
    Transport,
)
from ros_visualise.runtime.ros1 import clock, messages, services
from ros_visualise.runtime.ros1.descriptions import (
    SERVER,
    RobotDescription,
    asking_master,
    is_description,
    is_parameter,
)
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.messages import message_class
from ros_visualise.runtime.ros1.reconfigure_client import ReconfigureClient
from ros_visualise.runtime.ros1.reconfigure_server import ReconfigureServer
from ros_visualise.runtime.ros1.topics import Ros1Publisher, Ros1Subscriber

_IMAGE, _TEXT = "sensor_msgs/Image", "std_msgs/String"
_DESCRIPTION = "dynamic_reconfigure/ConfigDescription"
_SUFFIX = "/parameter_descriptions"
_ONLOOKERS = ("rosout", "rviz", "rqt", "record", "rostopic", "dynparam")
"""Beginnings of the names of nodes that only look on."""


class Ros1Transport(Transport):
    """The topics and services of this process's node, which has begun."""

    def close(self) -> None:
        rospy.signal_shutdown("done")

    def resolve(self, name: str) -> str:
        return str(rospy.resolve_name(name)) if name != "~" else str(rospy.get_name())

    def advertise(self, topic: str, type: TopicType) -> Ros1Publisher:
        return messages.advertise(topic, type)

    def subscribe(
        self,
        topic: str,
        kind: type[Message],
        take: Callable[[Any], None],
        reject: Callable[[str], None],
    ) -> Subscriber:
        if kind is Text and is_parameter(name := self.resolve(topic)):
            return RobotDescription(name, take, reject)

        def taken(message: Any) -> None:
            try:
                data: Any = from_message(message, kind)
            except ValueError as error:
                reject(str(error))
            else:
                take(data)

        def heard(message: Any) -> None:
            attempt(self.resolve(topic), partial(taken, message))

        return Ros1Subscriber(topic, message_class(kind.type_name), heard, reject)

    def offer(self, action: str, act: Callable[[], str | None]) -> Handle:
        return services.trigger(action, act)

    def offer_calibration(self, service: str, take: Callable[[CameraInfo], None]) -> Handle:
        return services.set_camera_info(service, take)

    def call(self, action: str) -> None:
        services.call(action)

    def serve_parameters(self, parameters: Parameters[Any], namespace: str) -> ReconfigureServer:
        return ReconfigureServer(parameters, namespace)

    def follow_parameters(self, node: str, listener: ParametersListener) -> ReconfigureClient:
        return ReconfigureClient(node, listener)

    @translated(MASTER)
    def listing(self) -> Listing:
        with asking_master() as master:
            publishers, subscribers, _ = master.getSystemState()
            types = master.getTopicTypes()
            robots = [name for name in master.getParamNames() if is_description(name)]
        known = dict(types)
        robots = [name for name in robots if name not in known]
        publishers += [[name, [SERVER]] for name in robots]
        return list_graph(publishers, subscribers, [*types, *((name, _TEXT) for name in robots)])

    def clock(self) -> Clock:
        return clock.ros_clock()


def list_graph(
    publishers: Sequence[tuple[str, list[str]]],
    subscribers: Sequence[tuple[str, list[str]]],
    types: Sequence[tuple[str, str]],
) -> Listing:
    """The graph by the master's lists: topics and their nodes, topics and their types."""
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
    """True if parameters are a node's own, and not those of image_transport's plugins."""
    return type_of.get(description.removesuffix(_SUFFIX).rpartition("/")[0]) != _IMAGE
