"""Recorded messages on the ROS graph: their bytes as they stand, whatever their type."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import genpy

from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros1.topics import Ros1Publisher
from ros_visualise.sinks.encoding import Encoder, TopicDeclaration


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
