"""The time of a graph, published by the process that makes it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ros_visualise.core import supervision
from ros_visualise.data.values import ClockTime
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.middleware import Publisher, Transport

_PERIOD_S = 0.01


def advertise_clock(transport: Transport) -> Publisher:
    """Advertise ``/clock``."""
    return transport.advertise("/clock", TopicType(ClockTime.type_name))


class ClockPublisher:
    """Publishes ``/clock``, a hundred times a second.

    Args:
        transport: of the graph.
        now_ns: gives the time.
    """

    def __init__(self, transport: Transport, now_ns: Callable[[], int]) -> None:
        self._now_ns = now_ns
        self._publisher = advertise_clock(transport)
        self._closed = threading.Event()
        self._thread = supervision.start("clock", self._run, again_s=_PERIOD_S)

    def close(self) -> None:
        """Time stands still."""
        self._closed.set()
        self._thread.join()
        self._publisher.close()

    def _run(self) -> None:
        while not self._closed.wait(_PERIOD_S):
            self._publisher.publish(ClockTime(self._now_ns()))
