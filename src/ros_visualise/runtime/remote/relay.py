"""One topic of a remote graph, subscribed only while it is shown or recorded."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from ros_visualise.core.rate import Clock, Steady, WallClock
from ros_visualise.data import Image
from ros_visualise.runtime.bridge.inputs import ImageInput, Input
from ros_visualise.runtime.ingress import Ingress, Numbering
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import TopicReport
from ros_visualise.runtime.topics import CallbackListener, Listener, Topic


class Relay:
    """Hands the messages of a topic to its listeners.

    Args:
        transport: on which the topic is.
        name: of the topic.
        kind: class of its messages.
        numbering: shared by all topics.
    """

    def __init__(self, transport: Transport, name: str, kind: type, numbering: Numbering) -> None:
        self._transport = transport
        self._name = name
        self._kind = kind
        self._topic = Topic(name, on_demand=True)
        self._ingress = Ingress(name, self._topic, numbering)
        self._input: Input | None = None
        self._dropped = 0
        self._lock = threading.Lock()

    @property
    def dropped(self) -> int:
        """Messages dropped on their way here, replaced by newer ones."""
        return self._dropped + (self._input.dropped if self._input is not None else 0)

    @property
    def is_open(self) -> bool:
        """True while it is subscribed to."""
        return self._input is not None

    def connect(self, listener: Listener, compressed: bool, latched: bool = False) -> None:
        """Add a listener.

        Args:
            listener: takes the messages.
            compressed: subscribe to the compressed images, unless already subscribed.
            latched: hand it the last message at once.

        Raises:
            UsageError: the topic cannot be subscribed to; the listener is not added.
        """
        with self._lock:
            self._topic.connect(listener, latched)
            try:
                if self._input is None:
                    opened = self._made(compressed)
                    opened.open()
                    self._input = opened
            except BaseException:
                self._topic.disconnect(listener)
                raise

    def disconnect(self, listener: Listener) -> None:
        """Remove a listener; further calls have no effect."""
        with self._lock:
            self._topic.disconnect(listener)
            if not self._topic.listeners and self._input is not None:
                self._input.close()
                self._dropped += self._input.dropped
                self._input = None

    def _made(self, compressed: bool) -> Input:
        if self._kind is Image:
            feed = self._ingress.publish
            return ImageInput(self._transport, self._name, self._name, feed, compressed)
        return Input(self._transport, self._name, self._kind, self._ingress.publish)

    def close(self) -> None:
        """Remove all listeners."""
        for listener in self._topic.listeners:
            self.disconnect(listener)

    def report(self, type_name: str, window_s: float | None) -> TopicReport:
        """Counts and rates of received messages."""
        return self._topic.report(type_name, window_s)


def arrival_listener(recording: RecorderThread, topic: str, relay: Relay) -> Listener:
    """A listener that records a topic; what its relay drops counts as dropped by the recording."""
    dropped = relay.dropped

    def put(packet: Packet) -> None:
        nonlocal dropped
        before, dropped = dropped, relay.dropped
        recording.missed(dropped - before)
        recording.put(topic, packet)

    return CallbackListener(put)


def steady_time(clock: Clock) -> Callable[[], int]:
    """The time of a graph, as ``rosbag record`` stamps messages, nanoseconds.

    It goes on evenly where the wall clock is set; 0 until simulated time has begun.
    """
    if not isinstance(clock, WallClock):
        return clock.now_ns
    steady = Steady()
    return lambda: steady.of(clock.now_ns(), time.monotonic_ns())
