"""Our messages on topics of the ROS graph."""

from __future__ import annotations

from typing import Any

from ros_visualise.data import Text
from ros_visualise.messages import to_message
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros1.errors import sending
from ros_visualise.runtime.ros1.raw import RawPublisher
from ros_visualise.runtime.ros1.registration import set_param
from ros_visualise.runtime.ros1.topics import Ros1Publisher
from ros_visualise.runtime.ros1.types import DEFINITIONS, TYPES, message_class


def advertise(topic: str, type: TopicType) -> Ros1Publisher:
    """A publisher for a topic; see `ros_visualise.runtime.middleware.Transport.advertise`."""
    if type.definitions is not None:
        return RawPublisher(topic, type)
    if type.data_class is Text and type.qos.transient_local:
        return DescriptionPublisher(topic, type)
    return MessagePublisher(topic, type)


class MessagePublisher(Ros1Publisher):
    """Publishes messages of `ros_visualise.data`.

    Args:
        topic: its name.
        type: its type.

    Raises:
        UsageError: ROS 1 has no such type.
    """

    def __init__(self, topic: str, type: TopicType) -> None:
        super().__init__(topic, message_class(type.name), latch=type.qos.transient_local)

    def publish(self, message: Any) -> None:
        """Send a message.

        Raises:
            DamagedMessage: ROS cannot hold it.
        """
        with sending(message, DEFINITIONS):
            super().publish(to_message(message, TYPES))


class DescriptionPublisher(MessagePublisher):
    """Publishes a robot's description, and sets the parameter of that name.

    ROS 1 looks for it on the parameter server, ROS 2 on a topic.
    """

    def publish(self, message: Text) -> None:
        """Send a description."""
        super().publish(message)  # where it cannot be, it is no description either
        set_param(self.name, message.text)
