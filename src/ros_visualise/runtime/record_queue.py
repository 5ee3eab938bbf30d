"""What waits to be recorded: in order, and never more than can be written soon."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

from ros_visualise.messages.recorded import recorded_ns
from ros_visualise.runtime.queues import END, FINISHED, Packet

log = logging.getLogger(__name__)

_MAX_BYTES = 64 * 2**20
_LATE_S = 0.3
_LATE_BYTES = 4 * 2**20  # that take next to no time to write, however late
_SMALL_BYTES = 32 * 1024  # of a message that costs next to nothing, as of transforms
_OVERDUE_S = 0.3
_LOOK_S = 0.1
_SAY_AGAIN_S = 10.0


class Order(Protocol):
    """Puts packets in order; see `ros_visualise.runtime.ordering.Ordering`."""

    @property
    def size(self) -> int:
        """Bytes of what waits."""

    @property
    def ended(self) -> bool:
        """Whether nothing more is to come."""

    @property
    def oldest_ns(self) -> int | None:
        """When the source let the next packet go, monotonic; None where nothing waits."""

    def waits(self, topic: str) -> bool:
        """Whether a message of a topic waits."""

    def put(self, topic: str, packet: Packet) -> None:
        """Take a packet."""

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic."""

    def first(self, at_once: bool) -> str | None:
        """The topic of the next packet if it is ready, or if it is wanted at once."""

    def take(self, topic: str) -> Packet:
        """The next packet, of the topic that `first` gave; it has a log time."""


class ArrivalOrder:
    """The order in which packets come: of topics of which nobody tells how they belong together."""

    size = 0
    ended = False
    oldest_ns: int | None = None  # nothing waits: each is ready at once

    def __init__(self) -> None:
        self._packets: deque[tuple[str, Packet]] = deque()

    def waits(self, topic: str) -> bool:
        """Whether a message of a topic waits: each is ready at once."""
        return False

    def put(self, topic: str, packet: Packet) -> None:
        """Take a packet."""
        if packet.message is not None and packet.number != FINISHED:
            self._packets.append((topic, packet))

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic; others go on."""

    def first(self, at_once: bool) -> str | None:
        """The topic of the oldest packet."""
        return self._packets[0][0] if self._packets else None

    def take(self, topic: str) -> Packet:
        """The oldest packet."""
        _, packet = self._packets.popleft()
        known = packet.log_ns is not None
        return packet if known else packet._replace(log_ns=recorded_ns(packet.message))


class _Ready(NamedTuple):
    topic: str
    packet: Packet
    size: int
    since_s: float


class RecordQueue:
    """Holds the packets of all recorded topics until they are written.

    Where messages may be dropped, a process that is killed loses no more than about a second: a
    large message that has waited for 0.3 s makes room for newer ones, and none waits long
    for what slow nodes make of it, which is written after it. What is dropped is counted, and
    logged at once and while it goes on. Else whoever publishes a message waits.

    Args:
        order: which packet is next, and when.
        lossless: whoever publishes waits.
        name: of the recording, to say what is dropped.
        clock: monotonic seconds.

    Attributes:
        dropped: messages for which there was no time.
        stopped: nothing more is taken; what waits can still be written.
    """

    def __init__(
        self, order: Order, lossless: bool, name: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.dropped = 0
        self.stopped = False
        self._order, self._lossless, self._name, self._clock = order, lossless, name, clock
        self._ready: deque[_Ready] = deque()
        self._ready_bytes = 0
        self._said_s = -_SAY_AGAIN_S
        self._changed = threading.Condition()

    def put(self, topic: str, packet: Packet) -> None:
        """Take what came on a topic, or the word that nothing comes for a number."""
        with self._changed:
            while self._lossless and self._is_full(topic, packet) and not self.stopped:
                self._changed.wait()
            if self.stopped:
                return
            if self._is_full(topic, packet):
                self._drop()
                packet = packet._replace(message=None)
            self._order.put(topic, packet)
            self._settle()

    def missed(self, count: int) -> None:
        """Count messages that were lost on their way here."""
        with self._changed:
            self.dropped += count

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic."""
        with self._changed:
            self._order.finish(topic)
            self._settle()

    def stop(self) -> None:
        """Take nothing more."""
        with self._changed:
            self.stopped = True
            self._changed.notify_all()

    def take(self) -> tuple[str, Packet] | None:
        """The next packet in order, and its topic; None at the end."""
        with self._changed:
            while not (self._ready or self.stopped or self._order.ended):
                self._changed.wait(None if self._lossless else _LOOK_S)
                self._settle()
            self._changed.notify_all()
            while self._ready:
                found = self._ready.popleft()
                self._ready_bytes -= found.size
                if not self._is_too_late(found):
                    return found.topic, found.packet
                self._drop()
            topic = self._order.first(at_once=True)
            return None if topic is None else (topic, self._order.take(topic))

    @property
    def late_s(self) -> float:
        """How long the next packet has been ready to be written, seconds."""
        try:
            return self._clock() - self._ready[0].since_s
        except IndexError:  # another thread may have taken it
            return 0.0

    def _settle(self) -> None:
        """Note what has become ready."""
        now_s = self._clock()
        while (topic := self._order.first(at_once=self._is_overdue(now_s))) is not None:
            packet = self._order.take(topic)
            size = 0 if packet.message is None else int(packet.message.nbytes)
            self._ready.append(_Ready(topic, packet, size, now_s))
            self._ready_bytes += size
        self._changed.notify_all()

    def _is_overdue(self, now_s: float) -> bool:
        """Whether the next packet is not to wait for others any more."""
        since_ns = self._order.oldest_ns
        return not self._lossless and since_ns is not None and now_s - since_ns / 1e9 > _OVERDUE_S

    def _is_full(self, topic: str, packet: Packet) -> bool:
        """Too much waits; but a topic on which others wait, or that ends, holds back all."""
        if packet.message is None or packet.number == END:
            return False
        if not self._ready and not self._order.waits(topic):
            return False
        size = self._order.size + self._ready_bytes
        if packet.message.nbytes <= _SMALL_BYTES:
            return size >= _MAX_BYTES + _LATE_BYTES
        is_late = self._lossless and self.late_s > _LATE_S
        return size >= (_LATE_BYTES if is_late else _MAX_BYTES)

    def _is_too_late(self, found: _Ready) -> bool:
        """Whether a message would keep newer ones from being written soon."""
        if self._lossless or found.size <= _SMALL_BYTES:
            return False
        return self._ready_bytes >= _LATE_BYTES and self._clock() - found.since_s > _LATE_S

    def _drop(self) -> None:
        """Count a message, and say so now and then."""
        self.dropped += 1
        if self._clock() - self._said_s >= _SAY_AGAIN_S:
            self._said_s = self._clock()
            count = "a message was" if self.dropped == 1 else f"{self.dropped} messages were"
            log.warning("%s: %s dropped by now: writing is too slow", self._name, count)
