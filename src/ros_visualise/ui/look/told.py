"""What nodes tell of themselves: lines of the log, and how they are doing."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ros_visualise.data import DiagnosticArray, DiagnosticStatus
from ros_visualise.data.reports import Log
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.diagnostics import StatusMaker
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.look.logs import Lines

_WAITING = 1000  # messages of a topic between two rounds
_PERIOD_S = 1.0
_MOST = 1000  # statuses


class _Heard(NamedTuple):
    status: DiagnosticStatus
    time_s: float


class Told:
    """Listens to what all nodes of a graph tell of themselves, as long as the page is there.

    Args:
        runtime: what runs.
        lines: where lines of the log go; those that this process logs are there without.
        clock: seconds.
    """

    def __init__(
        self, runtime: Runtime, lines: Lines, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._runtime, self._lines, self._clock = runtime, lines, clock
        self._heard: dict[str, _Heard] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._own, self._own_s = StatusMaker(), float("-inf")
        self._lock = threading.Lock()

    def take(self) -> None:
        """Take in what has come since; to be called a few times a second."""
        topics = self._topics()
        for topic in self._subscriptions.keys() - topics:
            self._subscriptions.pop(topic).close()
        for topic in topics - self._subscriptions.keys():
            self._subscriptions[topic] = self._runtime.subscribe(topic, _WAITING)
        for subscription in self._subscriptions.values():
            while (message := subscription.take(0)) is not None:
                self._hear(message)
        if not self._runtime.name and self._clock() - self._own_s >= _PERIOD_S:
            self._own_s = self._clock()
            self._keep(self._statuses())

    def statuses(self) -> list[dict[str, Any]]:
        """The newest status by each name, and for how many seconds nothing newer has come."""
        with self._lock:
            return [_as_values(heard, self._clock()) for heard in self._heard.values()]

    def close(self) -> None:
        """Listen no more."""
        for subscription in self._subscriptions.values():
            subscription.close()
        self._subscriptions = {}

    def _topics(self) -> set[str]:
        """Those on which nodes tell of themselves: of the graph, and beside it."""
        graph = self._runtime.graph.topics.items()
        kinds: Mapping[str, type] = {name: one.type for name, one in graph}
        return {name for name, kind in kinds.items() if kind is DiagnosticArray} | set(
            self._runtime.diagnostic_topics
        )

    def _hear(self, message: Any) -> None:
        if isinstance(message, DiagnosticArray):
            self._keep(message.statuses)
        elif isinstance(message, Log) and message.node != self._runtime.name:
            time_s = message.header.stamp_ns / 1e9
            level = logging.getLevelName(message.level)
            self._lines.add(time_s, level, message.node, message.text)

    def _keep(self, statuses: Any) -> None:
        with self._lock:
            for status in statuses:
                self._heard[status.name] = _Heard(status, self._clock())
            while len(self._heard) > _MOST:
                del self._heard[next(iter(self._heard))]

    def _statuses(self) -> list[DiagnosticStatus]:
        """Of the nodes of this process."""
        nodes = self._runtime.report(_PERIOD_S).nodes.items()
        return [self._own.status(name, node, node.figures()) for name, node in nodes]


def _as_values(heard: _Heard, now_s: float) -> dict[str, Any]:
    status = heard.status
    return {
        "name": status.name,
        "level": int(status.level),
        "message": status.message,
        "values": list(status.values.items()),
        "age": now_s - heard.time_s,
    }
