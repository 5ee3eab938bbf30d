"""Queues of packets between the nodes of a process, which run on threads."""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, NamedTuple

END = 2**62
"""Number of a node's last answers, when its inputs have ended: after all others."""


FINISHED = 2**63
"""Number of the packet that ends a port."""


class Packet(NamedTuple):
    """A message on its way through the graph; None: the node has no answer to this number.

    ``number`` counts the messages of the source, ``arrival_ns`` is the monotonic time at which it
    published this one, and ``log_ns`` the time under which it is recorded, if known. Answers of
    nodes keep all three, so that a recorder can put all topics in order. ``port`` is the input that
    it waits for; ``epoch`` the number of jumps of time: seeks, reopened sources, clocks that went
    back. ``more``: another answer to this number follows. ``again``: the node had this message
    before.
    """

    number: int
    message: Any | None
    arrival_ns: int
    port: str = ""
    log_ns: int | None = None
    epoch: int = 0
    more: bool = False
    again: bool = False


class Inbox:
    """The packets that wait for one node or subscription.

    ``lossless``: `put` waits for room. Otherwise only the newest messages are kept, ``keep`` of
    each port, and those that they replace are counted in ``dropped``. May be switched at any time.
    ``discarded`` counts messages that came after `close`, or were discarded by it. ``heard`` is
    called after each `put`, if set.
    """

    def __init__(self, lossless: bool, depth: int = 2, keep: int = 1) -> None:
        self.dropped = self.discarded = 0
        self.heard: Callable[[], None] | None = None
        self._keep = keep
        self._lossless = lossless
        self._depth = depth
        self._packets: deque[Packet] = deque()
        self._waiting: Counter[str] = Counter()  # messages by port
        self._taken: Packet | None = None  # the last one with a message
        self._number = 0
        self._again = False
        self._closed = False
        self._changed = threading.Condition()

    @property
    def lossless(self) -> bool:
        """True if `put` waits for room."""
        return self._lossless

    @lossless.setter
    def lossless(self, lossless: bool) -> None:
        with self._changed:
            self._lossless = lossless
            self._changed.notify_all()

    @property
    def ended(self) -> bool:
        """True if nothing more can be taken."""
        with self._changed:
            return self._closed and not self._packets

    def put(self, packet: Packet, keep: int | None = None) -> None:
        """Add a packet; after `close` it is discarded.

        Args:
            packet: to be added.
            keep: number of messages of its port that may wait, if not that of all ports.
        """
        keep = self._keep if keep is None else keep
        with self._changed:
            while self._lossless and len(self._packets) >= self._depth and not self._closed:
                self._changed.wait()
            if self._closed:
                self.discarded += packet.message is not None
                return
            if packet.message is not None:
                self._waiting[packet.port] += 1
                if not self._lossless and self._waiting[packet.port] > keep:
                    self._drop(packet.port, self._waiting[packet.port] - keep)
            elif self._packets and not self._lossless:
                return  # it would only take room
            self._packets.append(packet)
            self._changed.notify_all()
        if self.heard is not None:
            self.heard()

    def finish(self, port: str) -> None:
        """Nothing more comes on a port; this is taken after its last packet."""
        with self._changed:
            if not self._closed:
                self._packets.append(Packet(FINISHED, None, 0, port))
                self._changed.notify_all()

    def take(self, timeout_s: float | None = None) -> Packet | None:
        """The oldest packet; None when none came in time, or when closed and empty."""
        with self._changed:
            self._changed.wait_for(lambda: self._packets or self._closed or self._again, timeout_s)
            again, self._again = self._again, False
            if not self._packets:
                return self._repeated() if again and not self._closed else None
            packet = self._packets.popleft()
            if packet.number != FINISHED:
                self._number = packet.number
            if packet.message is not None:
                self._waiting[packet.port] -= 1
                self._taken = packet
            self._changed.notify_all()
            return packet

    def _drop(self, port: str, count: int) -> None:
        """Drop the oldest messages of a port, and packets without a message."""
        kept: deque[Packet] = deque()
        for packet in self._packets:
            if count and packet.port == port and packet.message is not None:
                count -= 1
                self.dropped += 1
                self._waiting[port] -= 1
            elif packet.message is not None or packet.number == FINISHED:
                kept.append(packet)
        self._packets = kept

    def wait_until_taken(self, timeout_s: float) -> None:
        """Wait until no packet waits."""
        with self._changed:
            self._changed.wait_for(lambda: self._closed or not self._packets, timeout_s)

    def repeat(self) -> None:
        """Return the last message once more from `take`, unless a new one comes before."""
        with self._changed:
            self._again = self._taken is not None
            self._changed.notify_all()

    def _repeated(self) -> Packet | None:
        assert self._taken is not None
        arrival_ns = time.monotonic_ns()
        return self._taken._replace(number=self._number, arrival_ns=arrival_ns, again=True)

    def close(self, discard: bool = False) -> None:
        """Nothing more comes in; waiting packets can still be taken unless discarded."""
        with self._changed:
            self._closed = True
            if discard:
                self.discarded += sum(one.message is not None for one in self._packets)
                self._packets.clear()
            self._changed.notify_all()
