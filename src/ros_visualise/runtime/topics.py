"""Topics inside a process: what is published on one is handed to its listeners."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError
from ros_visualise.core.supervision import ERRORS, attempt, note
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.counters import TopicCounter
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.report import TopicReport

log = logging.getLogger(__name__)


class Listener(Protocol):
    """Takes the packets of a topic, on the thread that publishes them."""

    def put(self, packet: Packet) -> None:
        """Take a packet."""

    def close(self) -> None:
        """Note the end of the stream."""


@dataclass(frozen=True, eq=False)
class CallbackListener:
    """A listener made of functions."""

    put: Callable[[Packet], None]
    close: Callable[[], None] = lambda: None


class Subscription:
    """The newest messages of one topic, to be taken; it never blocks a node.

    Attributes:
        epoch: number of jumps of time before the message taken last.
        log_ns: time under which the message taken last is recorded, if known.
    """

    def __init__(self, topic: str, inbox: Inbox, disconnect: Callable[[], None]) -> None:
        self._topic = topic
        self._inbox = inbox
        self._disconnect = disconnect
        self._has_warned = False
        self.epoch = 0
        self.log_ns: int | None = None

    @property
    def dropped(self) -> int:
        """Number of messages that were replaced by newer ones before they were taken."""
        return self._inbox.dropped

    @property
    def ended(self) -> bool:
        """True if the topic has ended and nothing waits: `take` gives nothing more."""
        return self._inbox.ended

    def take(self, timeout_s: float, decode: bool = True) -> Any | None:
        """The oldest message that waits; None if none came in time or the topic has ended.

        `ended` tells the two apart. Recorded messages are decoded if ``decode`` is set; damaged
        ones are skipped.
        """
        end_s = time.monotonic() + timeout_s
        while (packet := self._inbox.take(max(0.0, end_s - time.monotonic()))) is not None:
            self.epoch, self.log_ns = packet.epoch, packet.log_ns
            if packet.message is None:  # the node has no output for some number
                continue
            try:
                return content(packet.message) if decode else packet.message
            except DamagedMessage as error:
                self._warn(error)
        return None

    def notify(self, heard: Callable[[], None]) -> None:
        """Call this whenever a message comes, on the thread that publishes it."""
        self._inbox.heard = heard

    def close(self) -> None:
        """End it."""
        self._disconnect()
        self._inbox.close(discard=True)

    def _warn(self, error: DamagedMessage) -> None:
        if not self._has_warned:
            log.warning("%s: %s (further occurrences suppressed)", self._topic, error)
        self._has_warned = True


class Topic:
    """Hands the messages of one output to its listeners; one that fails does not affect others.

    Args:
        name: of the topic.
        on_demand: messages are made only while it has listeners.

    Attributes:
        listeners: its present listeners.
    """

    def __init__(self, name: str, on_demand: bool = False) -> None:
        self.on_demand = on_demand
        self._who = f"listener on {name}"
        self._counter = TopicCounter()
        self.listeners: tuple[Listener, ...] = ()
        self._wanted: dict[Listener, Callable[[], bool]] = {}
        self._last: Packet | None = None
        self._last_s = -math.inf
        self._finished = False
        self._lock = threading.Lock()

    @property
    def idle_s(self) -> float:
        """Seconds since the last message."""
        return time.monotonic() - self._last_s

    @property
    def reported(self) -> bool:
        """True if a report shows it: an on-demand output only if it has had listeners."""
        return not self.on_demand or bool(self.listeners) or self._counter.messages > 0

    @property
    def awaited(self) -> bool:
        """True if a listener wants the next message; also without listeners, as it is counted."""
        listeners = self.listeners
        return not listeners or any(self._wants(listener) for listener in listeners)

    def publish(self, packet: Packet, raises: bool = False) -> None:
        """Hand on a packet.

        Raises:
            RosVisualiseError: a listener rejects it, and those after it get nothing; only
                if ``raises`` is set.
        """
        with self._lock:  # a listener that connects meanwhile gets it exactly once
            listeners = self.listeners
            if packet.message is not None:
                self._last, self._last_s = packet, time.monotonic()
        if packet.message is not None and (listeners or not self.on_demand):
            self._counter.count(packet.message.header.stamp_ns, packet.epoch)
        for listener in listeners:
            try:
                listener.put(packet)
            except ERRORS as error:
                if raises and isinstance(error, RosVisualiseError):
                    raise
                note(self._who, error)

    def finish(self) -> None:
        """Note the end of the stream."""
        with self._lock:
            self._finished = True
        for listener in self.listeners:
            attempt(self._who, listener.close)

    def connect(
        self, listener: Listener, latched: bool = False, wants: Callable[[], bool] | None = None
    ) -> None:
        """Add a listener.

        Args:
            listener: gets every message from now on.
            latched: hand it the last message at once.
            wants: returns True while it has a use for messages; None: always.
        """
        with self._lock:
            if wants is not None:
                self._wanted[listener] = wants
            self.listeners += (listener,)
            if latched and self._last is not None:
                attempt(self._who, partial(listener.put, self._last))
            if self._finished:
                attempt(self._who, listener.close)

    def disconnect(self, listener: Listener) -> None:
        """Remove a listener."""
        with self._lock:
            self.listeners = tuple(one for one in self.listeners if one is not listener)

    def report(self, type_name: str, window_s: float | None) -> TopicReport:
        """Counts and rates, with messages of that type."""
        return self._counter.report(type_name, window_s)

    def _wants(self, listener: Listener) -> bool:
        wants = self._wanted.get(listener)
        try:
            return wants is None or wants()
        except ERRORS as error:
            note(self._who, error)
            return True
