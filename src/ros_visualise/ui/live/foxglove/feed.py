"""The messages of one topic, encoded once for all viewers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.recorded import TopicType, recorded_ns
from ros_visualise.runtime.topics import Subscription
from ros_visualise.sinks.encoding import Buffer, Encoder, TopicDeclaration

_WAIT_S, _PAUSE_S = 0.2, 0.02
_UNDERWAY = 8  # encoded messages that wait for the loop


class Encoded(NamedTuple):
    """A message: the time of its recording, 0 if it is unknown, and its bytes."""

    log_ns: int
    data: Buffer


class ChannelFeed:
    """Encodes the messages of a topic on a thread of its own, until it is closed.

    Args:
        topic: name of the topic.
        subscribe: subscribes to it.
        encoder: is used by one thread at a time.
        give: takes each message, on the feed's thread, and calls `release` when it is sent on.

    Attributes:
        dropped: number of messages that were not encoded: too many at once, or damaged.
        last: the newest message that was handed on.
        warning: why messages cannot be encoded; empty if they can.
    """

    def __init__(
        self,
        topic: str,
        subscribe: Callable[[], Subscription],
        encoder: LockedEncoder,
        give: Callable[[ChannelFeed, Encoded], None],
    ) -> None:
        self.topic, self.dropped, self.warning = topic, 0, ""
        self.last: Encoded | None = None
        self._subscribe, self._encoder, self._give = subscribe, encoder, give
        self._damaged = 0
        self._free = threading.Semaphore(_UNDERWAY)
        self._closed = threading.Event()
        supervision.start(f"foxglove {topic}", self._run)

    def release(self) -> None:
        """Note that a message was sent on."""
        self._free.release()

    def close(self) -> None:
        """End soon."""
        self._closed.set()

    def _run(self) -> None:
        subscription = self._subscribe()
        try:
            while not self._closed.is_set():
                if self._free.acquire(timeout=_WAIT_S) and not self._pass_on(subscription):
                    self._free.release()
                    self._closed.wait(_PAUSE_S)  # the topic may have ended
        finally:
            subscription.close()

    def _pass_on(self, subscription: Subscription) -> bool:
        """Encode the next message; False without one."""
        message = subscription.take(_WAIT_S, decode=False)
        self.dropped = subscription.dropped + self._damaged
        if message is None or self._closed.is_set():
            return False
        log_ns = recorded_ns(message) if subscription.log_ns is None else subscription.log_ns
        try:
            encoded = Encoded(log_ns, self._encoder.encode(message))
        except DamagedMessage as error:
            self._damaged, self.warning = self._damaged + 1, str(error)
            return False
        self._give(self, encoded)
        return True


class LockedEncoder:
    """An encoder to CDR for any thread."""

    def __init__(self) -> None:
        self._encoder, self._lock = Encoder("cdr"), threading.Lock()

    def declare(self, topic: TopicType) -> TopicDeclaration:
        """Call `Encoder.declare`."""
        with self._lock:
            return self._encoder.declare(topic)

    def encode(self, message: object) -> Buffer:
        """Call `Encoder.encode`."""
        with self._lock:
            return self._encoder.encode(message)
