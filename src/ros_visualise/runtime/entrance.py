"""Where messages from outside enter a graph: the one place that numbers them."""

from __future__ import annotations

import threading
import time
from typing import Any

from ros_visualise.runtime.epochs import Epochs
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.topics import Topic


class Numbering:
    """Counts what comes in on all topics together, and tells when time has jumped there."""

    def __init__(self) -> None:
        self._number = 0
        self._epochs = Epochs()
        self._lock = threading.Lock()

    def packet(self, topic: str, message: Any) -> Packet:
        """The next message, as it goes on through the graph."""
        with self._lock:
            self._number += 1
            arrival_ns = time.monotonic_ns()
            epoch = self._epochs.of(topic, message.header.stamp_ns, arrival_ns)
            return Packet(self._number, message, arrival_ns, epoch=epoch)


class Entrance:
    """Publishes what comes from outside on one topic, from whichever thread, in its order.

    Args:
        name: the topic's.
        topic: where it is published.
        numbering: shared by all topics that begin a graph.
    """

    def __init__(self, name: str, topic: Topic, numbering: Numbering) -> None:
        self._name, self._topic, self._numbering = name, topic, numbering
        self._turn = threading.Lock()

    def publish(self, message: Any) -> None:
        """Publish a message.

        Raises:
            RosVisualiseError: a source refuses it.
        """
        with self._turn:
            self._topic.publish(self._numbering.packet(self._name, message), heeds=True)
