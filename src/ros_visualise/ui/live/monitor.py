"""Log and diagnostics of all nodes, and their way to browsers.

A browser sends ``{"show": "log"}`` or ``{"show": "diagnostics"}``.
"""

from __future__ import annotations

import asyncio
import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from ros_visualise.data import DiagnosticArray, DiagnosticStatus
from ros_visualise.data.reports import Log
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.diagnostics import StatusMaker
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui.live.exchange import exchange, read_object, wait
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.server.gate import Receive, Scope, Send

_KEPT, _LONGEST = 1000, 2000  # lines, and their characters
_WAITING = 1000  # messages of a topic between two rounds
_ROUND_S, _SENDING_S = 0.25, 0.5
_PERIOD_S = 1.0
_MOST = 1000  # statuses
_LOGGER = "ros_visualise"


class MonitorHub:
    """Collects log and diagnostics of a graph all the time, and shows them to browsers."""

    path = "/live/monitor"

    def __init__(self) -> None:
        self.lines = LogLines()
        self._monitor: NodeMonitor | None = None
        self._rounds: PeriodicThread | None = None
        self._is_live = False
        self._shown: dict[object, str] = {}  # what each browser shows
        logging.getLogger(_LOGGER).addHandler(self.lines)

    def show(self, runtime: Runtime | None) -> None:
        """Collect those of this runtime from now on, or of none; from any thread."""
        if self._rounds is not None:
            self._rounds.close(0)
        self._monitor = self._rounds = None
        if runtime is not None:
            self._is_live = runtime.playback is None
            self._monitor = monitor = NodeMonitor(runtime, self.lines)
            self._rounds = PeriodicThread(
                "monitor", partial(self._take, monitor), monitor.close, _ROUND_S, lambda: False
            )
            self._rounds.start()

    def close(self) -> None:
        """End."""
        self.show(None)
        logging.getLogger(_LOGGER).removeHandler(self.lines)

    def _take(self, monitor: NodeMonitor) -> None:
        monitor.take("diagnostics" in list(self._shown.values()))

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves."""
        browser = object()
        news = asyncio.Event()

        def hear(text: str) -> None:
            self._shown[browser] = _shown(text)
            news.set()

        try:
            await exchange(receive, send, self._send_all(send, browser, news), hear)
        finally:
            self._shown.pop(browser, None)

    async def _send_all(self, send: Send, browser: object, news: asyncio.Event) -> None:
        shown, number, last = "", 0, ""
        while True:
            if self._shown.get(browser, "") != shown:
                shown, number, last = self._shown[browser], 0, ""
            message: Mapping[str, Any] = {}
            if shown == "log" and (lines := self.lines.after(number)):
                number, message = lines[-1]["number"], {"lines": lines}
            elif shown == "diagnostics" and self._monitor is not None:
                message = {"statuses": self._monitor.statuses(), "live": self._is_live}
            text = json.dumps(message) if message else ""
            if text and text != last:
                last = text
                await send({"type": "websocket.send", "text": text})
            await wait(news, _SENDING_S)


def _shown(text: str) -> str:
    """The request of a browser; empty for anything else than our pages ask."""
    shown = (read_object(text) or {}).get("show")
    return shown if isinstance(shown, str) else ""


class LogLines(logging.Handler):
    """The last lines of the log, numbered; safe to call from any thread."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self._lines: deque[dict[str, Any]] = deque(maxlen=_KEPT)
        self._number = 0
        self._guard = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        self.add(record.created, record.levelname, record.threadName or "", record.getMessage())

    def add(self, time_s: float, level: str, node: str, text: str) -> None:
        """Add a line; the time is seconds since 1970."""
        line = {"time": time_s, "level": level, "node": node, "text": text[:_LONGEST]}
        with self._guard:
            self._number += 1
            self._lines.append({"number": self._number, **line})

    def after(self, number: int) -> list[dict[str, Any]]:
        """Lines with larger numbers."""
        with self._guard:
            return [line for line in self._lines if line["number"] > number]


class _Heard(NamedTuple):
    status: DiagnosticStatus
    time_s: float


class NodeMonitor:
    """Collects log and diagnostics of all nodes of a graph.

    ``lines`` receives the log of other processes, beside that of this one.
    """

    def __init__(
        self, runtime: Runtime, lines: LogLines, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._runtime, self._lines, self._clock = runtime, lines, clock
        self._heard: dict[str, _Heard] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._own, self._own_s = StatusMaker(), float("-inf")
        self._lock = threading.Lock()

    def take(self, own: bool) -> None:
        """Take new messages, and with ``own`` those of this process's nodes; to be called often."""
        topics = self._topics()
        for topic in self._subscriptions.keys() - topics:
            self._subscriptions.pop(topic).close()
        for topic in topics - self._subscriptions.keys():
            self._subscriptions[topic] = self._runtime.subscribe(topic, _WAITING)
        for subscription in self._subscriptions.values():
            while (message := subscription.take(0)) is not None:
                self._hear(message)
        if own and not self._runtime.name and self._clock() - self._own_s >= _PERIOD_S:
            self._own_s = self._clock()
            self._keep(self._statuses())

    def statuses(self) -> list[dict[str, Any]]:
        """The newest status of each name, and its age in seconds."""
        with self._lock:
            return [_as_values(heard, self._clock()) for heard in self._heard.values()]

    def close(self) -> None:
        for subscription in self._subscriptions.values():
            subscription.close()
        self._subscriptions = {}

    def _topics(self) -> set[str]:
        """The topics of log and diagnostics, of the graph and beside it."""
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
        """Statuses of the nodes of this process."""
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
