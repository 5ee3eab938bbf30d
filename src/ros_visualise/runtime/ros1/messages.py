"""Messages as ROS 1 sends them: ours by its own classes, recorded ones as their bytes."""

from __future__ import annotations

from importlib import import_module
from io import BytesIO
from typing import Any

import genpy
from genpy.dynamic import generate_dynamic

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Text
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros1.errors import sending
from ros_visualise.runtime.ros1.registration import set_param
from ros_visualise.runtime.ros1.topics import Ros1Publisher
from ros_visualise.sinks.encoding import Encoder, TopicDeclaration

DEFINITIONS = Definitions("ros1")
"""ROS 1's own types."""


class _Types(dict[str, Any]):
    """Finds the class of a type when it is first asked for: that of its package, if installed.

    Raises:
        KeyError: ROS 1 has no such message.
    """

    def __missing__(self, type_name: str) -> Any:
        found = self[type_name] = _installed(type_name) or _generated(type_name)
        return found


TYPES = _Types(
    {
        "builtin_interfaces/msg/Time": genpy.Time,
        "builtin_interfaces/msg/Duration": genpy.Duration,
    }
)
"""ROS type name, as ``sensor_msgs/msg/Image`` -> class."""


def message_class(type_name: str) -> Any:
    """The class of the messages of a type, as ``sensor_msgs/msg/Image``.

    Raises:
        UsageError: ROS 1 has no such type.
    """
    try:
        return TYPES[type_name]
    except KeyError:
        raise UsageError(f"ROS 1 has no messages of type {type_name}") from None


def _installed(type_name: str) -> Any:
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name, None)
    except ImportError:
        return None


def _generated(type_name: str) -> Any:
    """A class made from the type's definition: it has the same MD5, and others understand it."""
    if not DEFINITIONS.knows(type_name):
        raise KeyError(type_name)
    name = type_name.replace("/msg/", "/")
    return generate_dynamic(name, DEFINITIONS.text(type_name))[name]


class RawMessage(genpy.Message):  # type: ignore[misc]
    """A message that is its bytes; a class of it for each type is made by `raw_class`."""

    __slots__ = ("body",)
    _has_header = False
    _slot_types = ("uint8[]",)

    def __init__(self, body: bytes | memoryview = b"") -> None:
        self.body = body

    def serialize(self, buffer: BytesIO) -> None:
        """Write the bytes."""
        buffer.write(self.body)

    def deserialize(self, data: bytes) -> RawMessage:
        """Keep the bytes."""
        self.body = data
        return self


def raw_class(declared: TopicDeclaration) -> type[RawMessage]:
    """The class of the messages of a type, which nobody here needs to know."""
    names = {
        "__slots__": (),
        "_type": declared.name.replace("/msg/", "/"),
        "_md5sum": declared.digest,
        "_full_text": declared.text,
    }
    return type("RawMessage", (RawMessage,), names)


class RawPublisher(Ros1Publisher):
    """Publishes a recorded topic.

    Args:
        topic: its name.
        type: its type.

    Raises:
        DamagedMessage: ROS 1 has no such type.
    """

    def __init__(self, topic: str, type: TopicType) -> None:
        self._encoder = Encoder("ros1")
        self._class = raw_class(self._encoder.declare(type))
        super().__init__(topic, self._class, latch=type.qos.transient_local)

    def publish(self, message: Any) -> None:
        """Send a message's bytes.

        Raises:
            DamagedMessage: it cannot be read, or ROS 1 cannot hold it.
        """
        super().publish(self._class(self._encoder.encode(message)))


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
