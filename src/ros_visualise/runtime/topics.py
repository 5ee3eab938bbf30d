"""The topics inside a process: who publishes hands its packets to whoever listens."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from ros_visualise.core.errors import DamagedMessage, RosVisualiseError
from ros_visualise.core.supervision import ERRORS, attempt, note
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.report import TopicReport
from ros_visualise.runtime.stats import TopicStats

log = logging.getLogger(__name__)


class Consumer(Protocol):
    """Who listens to a topic."""

    def put(self, packet: Packet) -> None:
        """Take a packet."""

    def close(self) -> None:
        """Nothing more comes."""


class Subscription:
    """Messages of one topic for whoever looks on; see `ros_visualise.runtime.base.Subscription`."""

    def __init__(self, topic: str, inbox: Inbox, disconnect: Callable[[], None]) -> None:
        self._topic = topic
        self._inbox = inbox
        self._disconnect = disconnect
        self._said = False
        self.epoch = 0

    def take(self, timeout_s: float, decode: bool = True) -> Any | None:
        """The oldest message that waits; None if none came in time or the topic ended.

        What a recording holds is decoded, if it is to be; what cannot be is left out.
        """
        end_s = time.monotonic() + timeout_s
        while (packet := self._inbox.take(max(0.0, end_s - time.monotonic()))) is not None:
            self.epoch = packet.epoch
            if packet.message is None:  # the node had nothing for some number
                continue
            try:
                return content(packet.message) if decode else packet.message
            except DamagedMessage as error:
                self._say(error)
        return None

    def close(self) -> None:
        """End it."""
        self._disconnect()
        self._inbox.close(discard=True)

    def _say(self, error: DamagedMessage) -> None:
        if not self._said:
            log.warning("%s: %s (said once)", self._topic, error)
        self._said = True


class Topic:
    """Hands what one output publishes to whoever listens; a listener that fails fails alone.

    Args:
        name: of the topic.
        on_demand: made only while somebody listens.
    """

    def __init__(self, name: str, on_demand: bool = False) -> None:
        self.on_demand = on_demand
        self._listener = f"listener on {name}"
        self._stats = TopicStats()
        self._listeners: tuple[Consumer, ...] = ()
        self._asked: dict[Consumer, Callable[[], bool]] = {}
        self._last: Packet | None = None
        self._last_s = -math.inf
        self._finished = False
        self._lock = threading.Lock()

    @property
    def idle_s(self) -> float:
        """Seconds since the last message."""
        return time.monotonic() - self._last_s

    @property
    def wanted(self) -> bool:
        """Whether a report tells of it: an output on demand only when somebody wanted it."""
        return not self.on_demand or bool(self._listeners) or self._stats.messages > 0

    @property
    def awaited(self) -> bool:
        """Whether anybody waits for the next message; by itself a topic is counted all the same."""
        listeners = self._listeners
        return not listeners or any(self._wants(listener) for listener in listeners)

    def publish(self, packet: Packet, heeds: bool = False) -> None:
        """Hand on a packet.

        Raises:
            RosVisualiseError: a listener refuses it, and those after it get nothing; only to a
                publisher that ``heeds`` that.
        """
        with self._lock:  # who connects meanwhile gets it in one way or the other, and once
            listeners = self._listeners
            if packet.message is not None:
                self._last, self._last_s = packet, time.monotonic()
        if packet.message is not None and (listeners or not self.on_demand):
            self._stats.count(packet.message.header.stamp_ns, packet.epoch)
        for listener in listeners:
            try:
                listener.put(packet)
            except ERRORS as error:
                if heeds and isinstance(error, RosVisualiseError):
                    raise
                note(self._listener, error)

    def finish(self) -> None:
        """Nothing more comes."""
        with self._lock:
            self._finished = True
        for listener in self._listeners:
            attempt(self._listener, listener.close)

    def connect(
        self, listener: Consumer, latched: bool = False, wants: Callable[[], bool] | None = None
    ) -> None:
        """Add a listener.

        Args:
            listener: gets every message from now on.
            latched: give it the last one at once.
            wants: whether it has a use for them just now; None: always.
        """
        with self._lock:
            if wants is not None:
                self._asked[listener] = wants
            self._listeners += (listener,)
            if latched and self._last is not None:
                attempt(self._listener, partial(listener.put, self._last))
            if self._finished:
                attempt(self._listener, listener.close)

    def disconnect(self, listener: Consumer) -> None:
        """Remove a listener."""
        with self._lock:
            self._listeners = tuple(one for one in self._listeners if one is not listener)

    def report(self, type_name: str, window_s: float | None) -> TopicReport:
        """Counts and rates, as of messages of that type."""
        return TopicReport(type_name, self._stats.messages, *self._stats.rates(window_s))

    def _wants(self, listener: Consumer) -> bool:
        """Whether a listener has a use for a message; one that cannot tell has."""
        ask = self._asked.get(listener)
        try:
            return ask is None or ask()
        except ERRORS as error:
            note(self._listener, error)
            return True
