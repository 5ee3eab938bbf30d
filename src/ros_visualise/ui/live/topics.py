"""Figures of a run for browsers: topics with rates, drops and latencies, and lines of text."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from functools import partial

from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.report import RunReport, TravelReport
from ros_visualise.ui.live.exchange import exchange, ignore
from ros_visualise.ui.periodic import PeriodicThread
from ros_visualise.ui.server.gate import Receive, Scope, Send

_PERIOD_S, _WINDOW_S = 1.0, 2.0
Cell = str | float | None


class TopicsHub:
    """Sends browsers the newest figures, which are made only while one shows them."""

    path = "/live/topics"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._text = ""
        self._news: set[asyncio.Event] = set()
        self._thread: PeriodicThread | None = None

    def show(self, runtime: Runtime | None) -> None:
        """Make the figures of this graph from now on, or none."""
        if self._thread is not None:
            self._thread.close(0)
            self._thread = None
        if runtime is not None:
            make = partial(self._make, runtime)
            self._thread = PeriodicThread("topics", make, lambda: None, _PERIOD_S, lambda: False)
            self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self.show(None)

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves; messages from it are ignored."""
        news = asyncio.Event()
        news.set()
        self._news.add(news)
        try:
            await exchange(receive, send, self._send_all(send, news), ignore)
        finally:
            self._news.discard(news)

    def put(self, text: str) -> None:
        """Send other figures; a slow browser skips those between. From any thread."""
        self._loop.call_soon_threadsafe(self._put, text)

    def _make(self, runtime: Runtime) -> None:
        if self._news:
            graph, report = runtime.graph, runtime.report(_WINDOW_S)
            if runtime.graph is graph:  # else the report may be of the next one
                self.put(figures(graph, report))

    def _put(self, text: str) -> None:
        self._text = text
        for news in self._news:
            news.set()

    async def _send_all(self, send: Send, news: asyncio.Event) -> None:
        while True:
            await news.wait()
            news.clear()
            if self._text:
                await send({"type": "websocket.send", "text": self._text})


def figures(graph: Graph, report: RunReport) -> str:
    """Rows and lines of a run report, as JSON."""
    return json.dumps({"rows": topic_rows(graph, report), "lines": list(lines_of(report))})


def topic_rows(graph: Graph, report: RunReport) -> list[list[Cell]]:
    """The topics of a run report: name, type, Hz, Hz by the wall clock, target Hz, number of
    messages lost and the reasons, median latency in ms; an unsupported topic is its name and type.
    """
    rows: list[list[Cell]] = []
    for name, topic in report.topics.items():
        node = report.nodes[graph.topics[name].publisher]
        reasons = ", ".join(f"{count} ({reason})" for reason, count in node.dropped.items())
        figures = [topic.hz, topic.wall_hz, node.requested_hz, node.lost, reasons, node.p50_ms]
        rows.append([name, _short(topic.type), *figures])
    return rows + [[name, _short(kind)] for name, kind in sorted(report.unknown.items())]


def lines_of(report: RunReport) -> Iterator[str]:
    """Lines about sources that ended, distances travelled and messages lost."""
    for name, node in report.nodes.items():
        if node.ended:
            yield f"{name}: ended; to play it again, switch off its parameter Paused"
        if node.travel:
            yield f"{name}: {_describe(node.travel)}"
        yield from (f"{name}: {note}" for note in node.unread)


def _describe(travel: TravelReport) -> str:
    parts = [f"{travel.length_m:.1f} m in {travel.duration_s:.1f} s"]
    for word, mps in (("mean", travel.mean_mps), ("max", travel.top_mps)):
        if mps is not None:
            parts.append(f"{word} {mps:.2f} m/s")
    if travel.refused:
        parts.append(f"{travel.refused} rejected")
    return ", ".join(parts)


def _short(kind: str) -> str:
    return kind.replace("/msg/", "/")
