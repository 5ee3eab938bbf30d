"""Queues of messages that wait to be recorded, never more than can soon be written."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from typing import NamedTuple

from ros_visualise.core.printing import counted
from ros_visualise.messages.recorded import recorded_ns
from ros_visualise.runtime.ordering import Ordering
from ros_visualise.runtime.queues import END, Packet

log = logging.getLogger(__name__)

_MAX_BYTES = 64 * 2**20
_LATE_S = 0.3
_LATE_BYTES = 4 * 2**20  # written in next to no time, however late
_SMALL_BYTES = 32 * 1024  # of a message that costs next to nothing, as of transforms
_LOG_AGAIN_S = 10.0


class _Ready(NamedTuple):
    topic: str
    packet: Packet
    size: int
    since_s: float


class ArrivalQueue:
    """Messages in the order of their arrival; those that writing is too slow for are dropped.

    A large message that cannot be written within 0.3 s makes room for newer ones, so that a process
    that is killed loses no more than about a second. Drops are counted, and logged at once and
    while they go on.

    A message has the log time that its source gave it. Of a foreign graph it is the time of arrival
    there; if that is unknown, the newest log time, or its stamp.

    Args:
        topics: after whose end nothing more is expected.
        name: of the recording, for the log.
        now_ns: gives the time of a foreign graph, nanoseconds; 0 if unknown.
        clock: monotonic seconds.

    Attributes:
        dropped: messages dropped because writing is too slow.
        stopped: True when nothing more is taken; waiting messages can still be written.
    """

    def __init__(
        self,
        topics: Collection[str],
        name: str,
        now_ns: Callable[[], int] = lambda: 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.dropped = 0
        self.stopped = False
        self._open = set(topics)
        self._name, self._now_ns, self._clock = name, now_ns, clock
        self._ready: deque[_Ready] = deque()
        self._ready_bytes = 0
        self._newest_ns = 0
        self._logged_s = -_LOG_AGAIN_S
        self._changed = threading.Condition()

    def put(self, topic: str, packet: Packet) -> None:
        """Add a message of a topic."""
        with self._changed:
            if packet.message is None or self.stopped:
                return
            if self._ready and self._is_full(packet.message.nbytes, self._ready_bytes):
                self._drop()
                return
            self._make_ready(topic, packet._replace(log_ns=self._log_ns(packet)))
            self._changed.notify_all()

    def finish(self, topic: str) -> None:
        """Nothing more comes on a topic."""
        with self._changed:
            self._open.discard(topic)
            self._changed.notify_all()

    def missed(self, count: int) -> None:
        """Count messages that were dropped on their way here."""
        with self._changed:
            self.dropped += 0 if self.stopped else count

    def stop(self) -> None:
        """Take nothing more."""
        with self._changed:
            self.stopped = True
            self._changed.notify_all()

    def take(self) -> tuple[str, Packet] | None:
        """The next message with its topic; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready or self.stopped or not self._open)
            return self._next()

    @property
    def late_s(self) -> float:
        """Seconds since the next message became ready to be written."""
        try:
            return self._clock() - self._ready[0].since_s
        except IndexError:  # another thread may have taken it
            return 0.0

    def _next(self) -> tuple[str, Packet] | None:
        self._changed.notify_all()
        while self._ready:
            found = self._ready.popleft()
            self._ready_bytes -= found.size
            if not self._is_too_late(found):
                return found.topic, found.packet
            self._drop()
        return None

    def _log_ns(self, packet: Packet) -> int:
        if packet.log_ns is not None:
            self._newest_ns = max(self._newest_ns, packet.log_ns)
            return packet.log_ns
        return self._now_ns() or self._newest_ns or recorded_ns(packet.message)

    def _make_ready(self, topic: str, packet: Packet) -> None:
        size = 0 if packet.message is None else int(packet.message.nbytes)
        self._ready.append(_Ready(topic, packet, size, self._clock()))
        self._ready_bytes += size

    def _is_full(self, added: int, waiting: int) -> bool:
        """True if a message of ``added`` bytes has no room beside those that wait."""
        return waiting >= _MAX_BYTES + (_LATE_BYTES if added <= _SMALL_BYTES else 0)

    def _is_too_late(self, found: _Ready) -> bool:
        """True if a message would keep newer ones from being written soon."""
        is_late = self._clock() - found.since_s > _LATE_S
        return is_late and found.size > _SMALL_BYTES and self._ready_bytes >= _LATE_BYTES

    def _drop(self) -> None:
        """Count a dropped message, and log the count now and then."""
        self.dropped += 1
        if self._clock() - self._logged_s >= _LOG_AGAIN_S:
            self._logged_s = self._clock()
            count = counted(self.dropped, "message")
            log.warning("%s: %s dropped so far, as writing is too slow", self._name, count)


class OrderedQueue(ArrivalQueue):
    """Messages in the order and under the times of `Ordering`; publishers wait, nothing is dropped.

    Args:
        order: of the messages.
        name, clock: as of `ArrivalQueue`.
    """

    def __init__(
        self, order: Ordering, name: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__(order.inputs, name, clock=clock)
        self._order = order

    def put(self, topic: str, packet: Packet) -> None:
        """Add a packet of a topic, also one without a message."""
        with self._changed:
            self._changed.wait_for(lambda: self.stopped or self._has_room(topic, packet))
            if not self.stopped:
                self._order.put(topic, packet)
                self._settle()

    def finish(self, topic: str) -> None:
        """Nothing more comes on a topic."""
        with self._changed:
            self._order.finish(topic)
            self._settle()

    def take(self) -> tuple[str, Packet] | None:
        """The next packet with its topic; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready or self.stopped or self._order.ended)
            if (found := self._next()) is not None:
                return found
            topic = self._order.first(at_once=True)
            return None if topic is None else (topic, self._order.take(topic))

    def _settle(self) -> None:
        """Move packets that are in order to those that are ready."""
        while (topic := self._order.first(at_once=False)) is not None:
            self._make_ready(topic, self._order.take(topic))
        self._changed.notify_all()

    def _has_room(self, topic: str, packet: Packet) -> bool:
        """False if too much waits; always true for a topic on which others wait, or that ends."""
        if packet.message is None or packet.number == END:
            return True
        if not self._ready and not self._order.waits(topic):
            return True
        waiting, size = self._order.size + self._ready_bytes, packet.message.nbytes
        if self.late_s > _LATE_S and size > _SMALL_BYTES:
            return waiting < _LATE_BYTES
        return not self._is_full(size, waiting)

    def _is_too_late(self, found: _Ready) -> bool:
        return False
