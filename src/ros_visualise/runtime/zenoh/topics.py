"""Topics as CDR messages, those that are latched kept by their publishers."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import zenoh
from zenoh import ext

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, Unreachable
from ros_visualise.messages import data_class, from_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.send_queue import SendQueue
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.zenoh import keys
from ros_visualise.runtime.zenoh.errors import translated
from ros_visualise.runtime.zenoh.session import ZenohSession
from ros_visualise.sinks.encoding import Encoder

DEFINITIONS = Definitions("cdr")
_ENCODER = Encoder("cdr")
_WAITING = 256
_KEPT = 100
"""Latched messages of one publisher that a late subscriber gets at most."""


class ZenohPublisher:
    """Publishes a topic; see `ros_visualise.runtime.middleware.Publisher`.

    A thread sends: a slow network holds up nobody who publishes. Meanwhile as many messages wait as
    their class has it; a newer one replaces the oldest.

    Args:
        session: of this process.
        name: the topic's full name.
        type: its type.

    Attributes:
        name: the topic's full name.

    Raises:
        DamagedMessage: ROS 2 cannot hold this type, which comes from a recording.
    """

    def __init__(self, session: ZenohSession, name: str, type: TopicType) -> None:
        declared = _ENCODER.declare(type)
        self.name = name
        self._unsent = 0
        self._type = declared.name
        self._graph = session.graph
        latched = type.qos.transient_local
        self._publisher = ext.declare_advanced_publisher(
            session.zenoh,
            keys.topic_key(name, declared.name, declared.digest),
            congestion_control=zenoh.CongestionControl.BLOCK,
            cache=ext.CacheConfig(max_samples=type.qos.depth) if latched else None,
            publisher_detection=latched,
        )
        self._token, key = session.declare(
            keys.PUBLISHER, name, declared.name, declared.digest, type.qos
        )
        self._attachments = keys.Attachments(key)
        room = getattr(data_class(type.name), "waiting", _WAITING)
        self._queue = SendQueue(name, self._send, room)

    @property
    def connections(self) -> int:
        """The number of subscribers."""
        is_closed = self._queue.closed
        return 0 if is_closed else self._graph.count(keys.SUBSCRIBER, self.name, self._type)

    @property
    def dropped(self) -> int:
        """Messages that had to make room for newer ones, or that could not be sent."""
        return self._queue.dropped + self._unsent

    def publish(self, message: Any) -> None:
        """Have a message sent; after `close`, to nobody.

        Raises:
            DamagedMessage: it cannot be sent, as one with a stamp before 1970.
        """
        self._queue.put(b"".join(_ENCODER.parts(message)))

    def flush(self, timeout_s: float) -> None:
        """Wait until the last message is on its way."""
        self._queue.flush(timeout_s)

    def wait_for_room(self, timeout_s: float) -> None:
        """Wait until another message can wait."""
        self._queue.wait_for_room(timeout_s)

    def close(self) -> None:
        """Leave the topic."""
        if self._queue.close():
            self._token.undeclare()
            self._publisher.undeclare()

    def _send(self, data: bytes) -> None:
        attachment, cdr = self._attachments.next(), zenoh.Encoding.APPLICATION_CDR
        try:
            with translated(self.name):
                self._publisher.put(data, encoding=cdr, attachment=attachment)
        except Unreachable:
            self._unsent += not self._queue.closed


class ZenohSubscriber:
    """Subscribes to a topic; see `ros_visualise.runtime.middleware.Transport.subscribe`.

    Args:
        session: of this process.
        name: the topic's full name.
        kind: the class of ours that its messages become.
        take, reject: as of `Transport.subscribe`.
    """

    def __init__(
        self,
        session: ZenohSession,
        name: str,
        kind: Any,
        take: Callable[[Any], None],
        reject: Callable[[str], None],
    ) -> None:
        declared = _ENCODER.declare(TopicType(kind.type_name))
        self._name, self._kind, self._take, self._reject = name, kind, take, reject
        self._inbox = Inbox(lossless=False, keep=max(kind.waiting, 2))
        self._gaps = keys.Gaps()
        self._subscriber = ext.declare_advanced_subscriber(
            session.zenoh,
            keys.topic_key(name, declared.name, "*"),
            self._put,
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=_KEPT),
        )
        self._token, _ = session.declare(keys.SUBSCRIBER, name, declared.name, declared.digest)
        self._closed = False
        supervision.start(name, self._run, again_s=0)

    @property
    def dropped(self) -> int:
        """Messages that were skipped for newer ones, or never came, as those beyond the limit."""
        return self._inbox.dropped + self._gaps.missing

    def close(self) -> None:
        """Leave the topic."""
        if not self._closed:
            self._closed = True
            self._inbox.close(discard=True)
            self._token.undeclare()
            self._subscriber.undeclare()

    def _put(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT:
            if sample.attachment is not None:
                self._gaps.take(sample.attachment.to_bytes())
            self._inbox.put(Packet(0, sample.payload, time.monotonic_ns()))

    def _run(self) -> None:
        while (packet := self._inbox.take()) is not None:
            supervision.attempt(self._name, partial(self._hand_on, packet.message))

    def _hand_on(self, payload: Any) -> None:
        try:
            read = DEFINITIONS.read(self._kind.type_name, payload.to_bytes())
            message: Any = from_message(read, self._kind)
        except (DamagedMessage, ValueError) as error:
            self._reject(str(error))
        else:
            self._take(message)
