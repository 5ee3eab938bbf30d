"""The inputs of a source, also of one that is told what nodes make of its own messages."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Collection

from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.source_thread import SourceThread

_LOOK_S = 0.1


class SourceInput:
    """Hands what comes on a topic to an input of the source, on the thread that publishes it.

    Args:
        source: on its thread.
        port: the input.
        origins: those of the source's topics that this one is made from.
    """

    def __init__(self, source: SourceThread, port: str, origins: Collection[str]) -> None:
        self._source, self._port, self._origins = source, port, origins
        self._answered = -1
        self._closed = False
        self._changed = threading.Condition()

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        if packet.message is not None:
            self._source.receive(self._port, packet.message)
        with self._changed:
            self._answered = max(self._answered, packet.number - packet.more)
            self._changed.notify_all()

    def close(self) -> None:
        """Nothing more comes; the source goes on without."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def wait_for(
        self, number: int, topic: str, goes_on: Callable[[], bool], patience_s: float
    ) -> None:
        """Wait until the nodes have answered a message of the source, where it waits for that.

        Args:
            number: of the message.
            topic: where the source published it.
            goes_on: whether to wait on.
            patience_s: how long to wait at most.
        """
        if topic not in self._origins or not self._source.awaits(self._port):
            return
        latest_s = time.monotonic() + patience_s
        with self._changed:
            while self._answered < number and not self._closed and goes_on():
                if time.monotonic() > latest_s:
                    return
                self._changed.wait(_LOOK_S)
