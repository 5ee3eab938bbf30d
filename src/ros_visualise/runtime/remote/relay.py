"""One topic of the graph, subscribed only while somebody looks at it or records it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ros_visualise.core.rate import Clock, Steady, WallClock
from ros_visualise.data import Image
from ros_visualise.runtime.bridge.inputs import ImageInput, Input
from ros_visualise.runtime.entrance import Entrance, Numbering
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import TopicReport
from ros_visualise.runtime.topics import Consumer, Topic


class Relay:
    """Hands the messages of a topic to whoever listens.

    Args:
        transport: what they come by.
        name: the topic.
        kind: the class of its messages.
        numbering: shared by all that is received.
    """

    def __init__(self, transport: Transport, name: str, kind: type, numbering: Numbering) -> None:
        self._transport = transport
        self._name = name
        self._kind = kind
        self._topic = Topic(name, on_demand=True)
        self._entrance = Entrance(name, self._topic, numbering)
        self._listeners: list[Consumer] = []
        self._input: Input | None = None
        self._dropped = 0
        self._lock = threading.Lock()

    @property
    def dropped(self) -> int:
        """Messages that were skipped for newer ones on their way here."""
        return self._dropped + (self._input.dropped if self._input is not None else 0)

    @property
    def is_open(self) -> bool:
        """Whether it is subscribed to."""
        return self._input is not None

    def connect(self, listener: Consumer, compressed: bool, latched: bool = False) -> None:
        """Add a listener.

        Args:
            listener: who takes the messages.
            compressed: whether to subscribe to the compressed images, if nobody listens yet.
            latched: give it the last message at once, if there was one.

        Raises:
            UsageError: the topic cannot be subscribed to; the listener is not added.
        """
        with self._lock:
            self._listeners.append(listener)
            self._topic.connect(listener, latched)
            try:
                if self._input is None:
                    opened = self._made(compressed)
                    opened.open()
                    self._input = opened
            except BaseException:
                self._listeners.remove(listener)
                self._topic.disconnect(listener)
                raise

    def disconnect(self, listener: Consumer) -> None:
        """Remove a listener; more than once does no harm."""
        with self._lock:
            self._topic.disconnect(listener)
            self._listeners = [one for one in self._listeners if one is not listener]
            if not self._listeners and self._input is not None:
                self._input.close()
                self._dropped += self._input.dropped
                self._input = None

    def _made(self, compressed: bool) -> Input:
        if self._kind is Image:
            feed = self._entrance.publish
            return ImageInput(self._transport, self._name, self._name, feed, compressed)
        return Input(self._transport, self._name, self._kind, self._entrance.publish)

    def close(self) -> None:
        """Remove all listeners."""
        for listener in tuple(self._listeners):
            self.disconnect(listener)

    def report(self, type_name: str, window_s: float | None) -> TopicReport:
        """Counts and rates of what was received."""
        return self._topic.report(type_name, window_s)


class Arrivals:
    """Numbers and times the messages of all recorded topics as they arrive.

    They are written in this order and under the graph's time, as ``rosbag record`` does it, but
    that it goes on evenly where the clock on the wall is set. Nobody on a graph tells which
    message was made from which, nor that none will come.

    Args:
        recording: what they are written to; what is skipped on the way here counts as its drops.
        clock: the graph's.
        dropped: how many messages of a topic were skipped by now.
    """

    def __init__(
        self, recording: RecorderThread, clock: Clock, dropped: Callable[[str], int]
    ) -> None:
        self.inboxes: Mapping[str, Consumer] = {
            topic: _Arrival(self, topic, partial(dropped, topic)) for topic in recording.topics
        }
        self._recording = recording
        self._number = 0
        self._clock = clock
        self._steady = Steady() if isinstance(clock, WallClock) else None
        self._lock = threading.Lock()

    def put(self, topic: str, message: Any, missed: int) -> None:
        """A message has arrived.

        Args:
            topic: that it arrived on.
            message: the message.
            missed: how many were skipped before it.
        """
        with self._lock:
            self._recording.missed(missed)
            self._number += 1
            now_ns, arrival_ns = self._clock.now_ns(), time.monotonic_ns()
            if self._steady is not None:
                now_ns = self._steady.of(now_ns, arrival_ns)
            log_ns = now_ns or None  # none yet: /clock has not begun
            self._recording.put(topic, Packet(self._number, message, arrival_ns, log_ns=log_ns))


class _Arrival:
    def __init__(self, arrivals: Arrivals, topic: str, dropped: Callable[[], int]) -> None:
        self._arrivals, self._topic, self._dropped = arrivals, topic, dropped
        self._counted = dropped()

    def put(self, packet: Packet) -> None:
        before, self._counted = self._counted, self._dropped()
        self._arrivals.put(self._topic, packet.message, self._counted - before)

    def close(self) -> None:
        pass
