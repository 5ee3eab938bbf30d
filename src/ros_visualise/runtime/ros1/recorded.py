"""Recorded messages on the ROS graph: their bytes as they stand, whatever their type."""

from __future__ import annotations

import logging
from io import BytesIO
from typing import Any

import genpy

from ros_visualise.data import Transforms, TransformStamped
from ros_visualise.errors import DamagedMessage
from ros_visualise.messages.recorded import TopicType, content
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.ros1.topics import Output
from ros_visualise.runtime.ros1.transport import Publisher
from ros_visualise.sinks.encoding import Declaration, Encoder

log = logging.getLogger(__name__)

_TRANSFORMS = "tf2_msgs/msg/TFMessage"


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


def raw_class(declared: Declaration) -> type[RawMessage]:
    """The class of the messages of a type, which nobody here needs to know."""
    names = {
        "__slots__": (),
        "_type": declared.name.replace("/msg/", "/"),
        "_md5sum": declared.digest,
        "_full_text": declared.text,
    }
    return type("RawMessage", (RawMessage,), names)


class RecordedOutput(Output):
    """Publishes a recorded topic on the ROS graph.

    Args:
        name: the topic as the node calls it.
        topic: its type.

    Raises:
        DamagedMessage: ROS 1 has no such type.
    """

    def __init__(self, name: str, topic: TopicType) -> None:
        self._encoder = Encoder("ros1")
        declared = self._encoder.declare(topic)
        self._class = raw_class(declared)
        self._adds_up = topic.name == _TRANSFORMS and name.endswith("tf_static")
        self._latched = declared.latched or self._adds_up
        self._static: dict[str, TransformStamped] = {}
        self._refused = 0
        self._publisher = Publisher(name, self._class, latch=self._latched)

    def put(self, packet: Packet) -> None:
        """Publish a message; say of one that cannot be read that it is left out."""
        if packet.message is None or not (self._latched or self._publisher.connections):
            return
        try:
            self._publisher.publish(self._class(self._encode(packet.message)))
        except DamagedMessage as error:
            self._refuse(self._publisher, error)

    def _encode(self, message: Any) -> bytes | memoryview:
        return self._encoder.encode(self._all_of(message) if self._adds_up else message)

    def _all_of(self, message: Any) -> Transforms:
        """All static transforms so far: a latched topic of ROS 1 holds the last message alone."""
        found = content(message)
        self._static |= {one.child_frame_id: one for one in found.transforms}
        return Transforms(tuple(self._static.values()))
