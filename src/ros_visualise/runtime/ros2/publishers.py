"""Our messages on topics of the ROS 2 graph."""

from __future__ import annotations

import logging
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation

from ros_visualise.core.errors import UsageError
from ros_visualise.messages import data_class
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.send_queue import SendQueue
from ros_visualise.runtime.memory import Buffer
from ros_visualise.runtime.ros2 import rcl
from ros_visualise.runtime.ros2.qos_events import PublisherEventCallbacks
from ros_visualise.runtime.ros2.quality import (
    clash,
    full_name,
    is_named,
    overridden,
    profile,
)
from ros_visualise.runtime.ros2.session import Ros2Session, spelled
from ros_visualise.runtime.ros2.types import message_class
from ros_visualise.sinks.encoding import Buffer as Part
from ros_visualise.sinks.encoding import Encoder

log = logging.getLogger(__name__)

_ENCODER = Encoder("cdr")
_WAITING = 256
_LOOK_S = 0.05
_NAMED_S = 1.0
_LARGE_DEPTH = 3
"""Images that are kept until reliable subscribers have all of their pieces."""


def advertise(session: Ros2Session, topic: str, type: TopicType) -> Ros2Publisher | Unsent:
    """A publisher for a topic; see `ros_visualise.runtime.middleware.Transport.advertise`.

    What is recorded may be of types that are not installed here: such a topic is skipped.
    """
    try:
        return Ros2Publisher(session, topic, type)
    except UsageError as error:
        if type.definitions is None:
            raise
        log.warning("%s skipped: %s", topic, error)
        return Unsent(session.resolve(topic))


@dataclass(eq=False)
class Unsent:
    """A topic that ROS 2 cannot have here: nothing is published."""

    name: str
    connections: int = 0
    dropped: int = 0

    def publish(self, message: Any) -> None:
        """Nobody is there."""

    def flush(self, timeout_s: float) -> None:
        """Nothing is waited for."""

    def wait_for_room(self, timeout_s: float) -> None:
        """Nothing is waited for."""

    def close(self) -> None:
        """There is nothing to leave."""


class Ros2Publisher:
    """Publishes a topic, as the bytes of its messages.

    Each publisher has a thread: one that has to wait for a reliable subscriber holds up nobody.
    Meanwhile as many messages wait as their class has it; a newer one replaces the oldest.

    Args:
        session: of this process.
        topic: its name.
        type: its type.

    Attributes:
        name: the topic's full name on the graph.

    Raises:
        UsageError: ROS 2 has no such type, or the name is invalid.
        DamagedMessage: it cannot hold this type, which comes from a recording.
    """

    def __init__(self, session: Ros2Session, topic: str, type: TopicType) -> None:
        declared = _ENCODER.declare(type)
        self.name = session.resolve(topic)
        self._node = session.node
        room = getattr(data_class(type.name), "waiting", _WAITING)
        is_large = room < type.qos.depth
        depth = _LARGE_DEPTH if is_large else type.qos.depth
        events = PublisherEventCallbacks(
            incompatible_qos=lambda _: session.start(f"{self.name} QoS", self._report_why),
            use_default_callbacks=False,
        )
        with overridden(session.node, self.name, "publisher") as overrides:
            self._publisher = session.node.create_publisher(
                message_class(declared.name),
                spelled(topic),
                profile(replace(type.qos, depth=depth)),
                event_callbacks=events,
                qos_overriding_options=overrides,
            )
        self._said: set[str] = set()
        self._buffer: Buffer = np.empty(0, np.uint8)
        self._unsent = 0
        self._queue = SendQueue(self.name, self._send, room, session.start)

    @property
    def connections(self) -> int:
        """The number of subscribers."""
        with suppress(rclpy_implementation.InvalidHandle):  # it is closed meanwhile
            return 0 if self._queue.closed else int(self._publisher.get_subscription_count())
        return 0

    @property
    def dropped(self) -> int:
        """Messages that had to make room for newer ones, or that ROS 2 did not send."""
        return self._queue.dropped + self._unsent

    def publish(self, message: Any) -> None:
        """Have a message sent; after `close`, to nobody.

        Raises:
            DamagedMessage: it cannot be sent, as one with a stamp before 1970.
        """
        self._queue.put(_ENCODER.parts(message))

    def flush(self, timeout_s: float) -> None:
        """Wait until everybody who reads on has been sent the last message."""
        end_s = time.monotonic() + timeout_s
        self._queue.flush(timeout_s)
        left_s = end_s - time.monotonic()
        if left_s > 0 and self.connections:
            with suppress(rcl.RclError):  # it is closed meanwhile
                rcl.wait_for_all_acked(self._publisher, left_s)

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until another message has room."""
        self._queue.wait_for_room(timeout_s)

    def close(self) -> None:
        """Leave the topic."""
        if self._queue.close():
            self._node.destroy_publisher(self._publisher)

    def _send(self, parts: list[Part]) -> None:
        try:
            rcl.publish(self._publisher, self._joined(parts))
        except rcl.RclError as error:
            if self._queue.closed:
                return
            self._unsent += 1
            if self._unsent == 1:
                text = "%s: message dropped: %s (further warnings suppressed)"
                log.warning(text, self.name, error)

    def _joined(self, parts: list[Part]) -> Buffer:
        """The parts one after the other, in memory that is kept for the next message."""
        size = sum(map(len, parts))
        if not size <= self._buffer.size <= 4 * size:
            self._buffer = np.empty(size, np.uint8)
        begin = 0
        for part in parts:
            end = begin + len(part)
            self._buffer[begin:end] = np.frombuffer(part, np.uint8)
            begin = end
        return self._buffer[:size]

    def _report_why(self) -> None:
        """Warn, once for each, of subscribers that get nothing."""
        publishers, subscribers = self._named_ends()
        node = self._node.get_fully_qualified_name()
        own = next((one for one in publishers if full_name(one) == node), None)
        for one in subscribers if own else ():
            why = clash(own, one)
            if why is not None and why not in self._said:
                self._said.add(why)
                log.warning("%s: incompatible QoS with a subscriber: %s", self.name, why)

    def _named_ends(self) -> tuple[list[Any], list[Any]]:
        """The topic's publishers and subscribers, whose nodes tell their names a little later."""
        end_s = time.monotonic() + _NAMED_S
        while True:
            publishers = self._node.get_publishers_info_by_topic(self.name)
            subscribers = self._node.get_subscriptions_info_by_topic(self.name)
            is_late = time.monotonic() > end_s or self._queue.closed
            if is_late or all(map(is_named, (*publishers, *subscribers))):
                return publishers, subscribers
            time.sleep(_LOOK_S)
