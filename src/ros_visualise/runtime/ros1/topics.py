"""Publishing and subscribing as rospy does it, without its copies of large messages.

rospy registers the topics, connects and keeps the connections; only what is sent and received on
our own topics goes another way: from the message's buffer to the sockets (see `outbox`), and from
the socket into the buffer that the message then holds (see `stream`); large messages between our
own nodes of one host go by memory (see `lending`). Stock rospy and roscpp at the other end see no
difference. Users of rospy's own classes on such a topic in the same process shares this way,
and gets numpy arrays too.

Measured at 3840x2160, from one process to another through sockets: 111 fps, by stock rospy 24, in
one run (see ``benchmarks/ros1``). Receiving without MSG_WAITALL halved that; the kernel's own
buffers were no slower than any that were set, and a send buffer of 4 MB was slower. By memory an
image takes a third of the processor time that it takes through sockets.
"""

from __future__ import annotations

import copy
import logging
import threading
import time
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import rospy
from rospy import topics
from rospy.impl.registration import Registration, get_topic_manager
from rospy.impl.tcpros_base import TCPROSTransport

from ros_visualise.runtime.ros1.outbox import Outbox
from ros_visualise.runtime.ros1.receiver import Receiver
from ros_visualise.runtime.ros1.wire import as_bytes, encode, is_large

log = logging.getLogger(__name__)

_LOOK_AGAIN_S = 0.002
_SAY_AGAIN_S = 10


class Ros1Publisher:
    """Publishes messages of one class; each subscriber gets the newest one that it has time for.

    A message's data is not copied: it must not change after it was published.

    Args:
        topic: relative names and remappings are resolved as everywhere in ROS.
        message_class: of genpy; the data of an Image, CompressedImage or PointCloud2 may be any
            buffer of bytes.
        latch: late subscribers get the last message at once.

    Attributes:
        name: the topic's full name on the graph.
    """

    def __init__(self, topic: str, message_class: Any, *, latch: bool = False) -> None:
        self.name = str(rospy.resolve_name(topic))
        with get_topic_manager().lock:
            _provide(Registration.PUB, topic, message_class, latch)
            queued = getattr(get_topic_manager().pubs.get(self.name), "queue_size", None)
            self._publisher = rospy.Publisher(
                topic,
                message_class,
                latch=latch,
                queue_size=1 if queued is None else queued,
                tcp_nodelay=True,
            )

    @property
    def connections(self) -> int:
        """The number of subscribers."""
        impl = self._publisher.impl
        return len(impl.connections or ()) if impl is not None else 0

    @property
    def dropped(self) -> int:
        """Messages that a subscriber had no time for, over all subscribers."""
        return int(getattr(self._publisher.impl, "dropped", 0))

    def publish(self, message: Any) -> None:
        """Send a message to all that are connected, without waiting; after `close`, to nobody.

        Raises:
            genpy.SerializationError: a field holds what it cannot.
        """
        impl = self._publisher.impl
        if impl is None or rospy.is_shutdown():
            return
        if isinstance(impl, _PublisherImpl):
            impl.publish(message)
        else:
            self._publish_by_rospy(message)

    def flush(self, timeout_s: float) -> None:
        """Wait until everybody who reads on has been sent the last message."""
        end_s = time.monotonic() + timeout_s
        for one in self._connections():
            if isinstance(one, Outbox):
                one.flush(max(end_s - time.monotonic(), 0))

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until there is a subscriber, or none at all, with no message waiting for it."""
        end_s = time.monotonic() + timeout_s
        while all(getattr(one, "is_full", False) for one in self._connections() or [None]):
            if time.monotonic() >= end_s:
                return
            time.sleep(_LOOK_AGAIN_S)

    def close(self) -> None:
        """Leave the topic."""
        if self._publisher.impl is not None:
            self._publisher.unregister()

    def _publish_by_rospy(self, message: Any) -> None:
        if is_large(message):
            message = copy.copy(message)
            message.data = as_bytes(message.data).tobytes()
        try:
            self._publisher.publish(message)
        except (rospy.ROSException, AttributeError):
            if self._publisher.impl is not None and not rospy.is_shutdown():
                raise  # else it was closed meanwhile

    def _connections(self) -> list[Any]:
        impl = self._publisher.impl
        return list(impl.connections or ()) if impl is not None else []


class Ros1Subscriber:
    """Calls ``callback`` with each message of a topic, on a thread of its publisher's connection.

    The data of an Image, CompressedImage or PointCloud2 is a numpy array of uint8, which may be
    kept for as long as anybody likes. A publisher waits while the callback works: hand on and
    return. ``refuse`` is called with the reason why bytes are no message.

    Attributes:
        name: the topic's full name on the graph.
        dropped: none: a publisher waits, or drops and counts messages itself.
    """

    dropped = 0

    def __init__(
        self,
        topic: str,
        message_class: Any,
        callback: Callable[[Any], None],
        refuse: Callable[[str], None] | None = None,
    ) -> None:
        self.name = str(rospy.resolve_name(topic))
        self._refuse = refuse or partial(_report_rejected, self.name)
        with get_topic_manager().lock:
            ours = _provide(Registration.SUB, topic, message_class)
            self._refusers = get_topic_manager().subs[self.name].refusers if ours else []
            self._refusers.append(self._refuse)
            by_rospy = is_large(message_class) and not ours
            is_shared = self.name in get_topic_manager().subs  # and has the size that it has
            if by_rospy:
                callback = partial(_with_array, callback)
            self._subscriber = rospy.Subscriber(
                topic,
                message_class,
                callback,
                queue_size=1 if by_rospy and not is_shared else None,
                tcp_nodelay=True,
            )

    @property
    def connections(self) -> int:
        """The number of publishers."""
        impl = self._subscriber.impl
        return len(impl.connections or ()) if impl is not None else 0

    def close(self) -> None:
        """Leave the topic."""
        if self._subscriber.impl is not None:
            self._refusers.remove(self._refuse)
            self._subscriber.unregister()


class _PublisherImpl(topics._PublisherImpl):  # type: ignore[misc]
    """State of all publishers of one topic in this process, with an outbox per subscriber."""

    def __init__(self, topic: str, message_class: Any) -> None:
        super().__init__(topic, message_class)
        self.dropped = 0
        self._order = threading.RLock()  # rospy's own does not outlive close()

    def add_connection(self, connection: Any) -> bool:
        outbox = Outbox(connection)
        with self._order:
            if not super(topics._PublisherImpl, self).add_connection(outbox):
                connection.close()
                return False
            if self.is_latch and self.latch is not None:
                self.publish(self.latch, outbox)
        to_it = partial(self.publish, connection_override=outbox)
        for listener in self.subscriber_listeners or ():
            listener.peer_subscribe(self.resolved_name, self.publish, to_it)
        return True

    def remove_connection(self, connection: Any) -> None:
        super(topics._PublisherImpl, self).remove_connection(connection)
        for listener in self.subscriber_listeners or ():  # close() takes them away
            listener.peer_unsubscribe(self.resolved_name, len(self.connections))

    def publish(self, message: Any, connection_override: Any = None) -> bool:
        with self._order:
            if self.closed:
                return False
            outboxes = [connection_override] if connection_override else self.connections
            if not (outboxes or self.is_latch):
                return False
            parcel = encode(message, self.seq + 1)
            if self.is_latch:  # what cannot be sent is not kept for those who come later
                self.latch = message
            if not outboxes:
                return False
            self.seq += 1
            self.dropped += sum(outbox.offer(parcel) for outbox in outboxes)
            self.message_data_sent += parcel.size
            return True


class _SubscriberImpl(topics._SubscriberImpl):  # type: ignore[misc]
    """State of all subscribers of one topic in this process."""

    def __init__(self, topic: str, message_class: Any) -> None:
        super().__init__(topic, message_class)
        self.refusers: list[Callable[[str], None]] = []
        self.set_tcp_nodelay(True)  # before anybody connects

    def add_connection(self, connection: Any) -> bool:
        connection.receive_once = Receiver(connection, self.data_class, self._refuse)
        return bool(super().add_connection(connection))

    def _refuse(self, why: str) -> None:
        for refuse in tuple(self.refusers):
            refuse(why)

    def remove_connection(self, connection: Any) -> None:
        super().remove_connection(connection)
        receiver = vars(connection).pop("receive_once", None)  # a cycle that would keep the buffers
        if receiver is not None:
            receiver.close()


_IMPLS: dict[str, Any] = {Registration.PUB: _PublisherImpl, Registration.SUB: _SubscriberImpl}


def _provide(direction: str, topic: str, message_class: Any, latch: bool = False) -> bool:
    """Put our own object in rospy's place for this topic; whether it is there."""
    if not _fits():
        return False
    manager = get_topic_manager()
    there = manager.pubs if direction == Registration.PUB else manager.subs
    name = rospy.resolve_name(topic)
    if name not in there:
        impl = _IMPLS[direction](topic, message_class)
        if latch:
            impl.enable_latch()
        manager._add(impl, there, direction)
    return isinstance(there[name], _IMPLS[direction])


@cache
def _fits() -> bool:
    """True if this rospy is built as the versions that this was written for."""
    manager = get_topic_manager()
    there = [
        *(hasattr(manager, name) for name in ("lock", "pubs", "subs", "_add")),
        *(hasattr(topics._PublisherImpl, name) for name in ("add_connection", "publish")),
        hasattr(topics._SubscriberImpl, "add_connection"),
        *(hasattr(TCPROSTransport, name) for name in ("receive_once", "set_cleanup_callback")),
    ]
    if not all(there):
        log.warning(
            "unsupported rospy; using the stock transport, which is slower with large images"
        )
    return all(there)


def _report_rejected(topic: str, why: str) -> None:
    rospy.logwarn_throttle(_SAY_AGAIN_S, f"{topic}: {why}")


def _with_array(callback: Callable[[Any], None], message: Any) -> None:
    message = copy.copy(message)  # which others in this process get as well
    message.data = np.frombuffer(message.data, np.uint8)
    callback(message)
