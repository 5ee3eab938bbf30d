"""Messages for browsers: the newest of a topic as a tree, those before it, and tables of fields.

A browser sends ``{"topic": TOPIC, "number": N, "fields": [PATH]}``: the topic that it shows, the
number of an earlier message, null for the newest, and the columns of its table, null without one.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections import deque
from collections.abc import Mapping
from typing import Any

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.messages.numeric_fields import number_at
from ros_visualise.messages.recorded import as_ros
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.exchange import exchange, read_object, wait
from ros_visualise.ui.live.trees import tree_of
from ros_visualise.ui.server.gate import Receive, Scope, Send
from ros_visualise.ui.server.pool import Pool

_PERIOD_S = 0.2
_KEPT, _KEPT_BYTES = 200, 64 << 20
_LARGE_DEPTH = 2
_MOST_FIELDS = 30
_THREADS = 2


class MessageHub:
    """Shows browsers the messages of topics, which are subscribed to while they do."""

    path = "/live/messages"

    def __init__(self) -> None:
        self._pool = Pool("messages", _THREADS)
        self._runtime: Runtime | None = None

    def show(self, runtime: Runtime | None) -> None:
        """Show the topics of this runtime from now on, or none; from any thread."""
        self._runtime = runtime

    def close(self) -> None:
        """End all threads."""
        self._runtime = None
        self._pool.close()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves."""
        browser = _MessageReader(send)
        try:
            await exchange(receive, send, self._send_all(browser), browser.hear)
        finally:
            browser.follow(None)

    async def _send_all(self, browser: _MessageReader) -> None:
        while True:
            browser.follow(self._runtime)
            await browser.offer()
            text = await self._pool.do(browser.text)
            if text:
                await browser.send_text(text)
            await wait(browser.news, _PERIOD_S)


class _MessageReader:
    """One browser: its topic, and the last messages, numbered from 1 on."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self.news = asyncio.Event()
        self._runtime: Runtime | None = None
        self._offered: object = None
        self._asked: Mapping[str, Any] = {}
        self._sent: object = None
        self._feed: Feed | None = None
        self._topic = ""
        self._kept: deque[Any] = deque(maxlen=_KEPT)
        self._count = 0

    def hear(self, text: str) -> None:
        """Note what it shows; anything else than our pages send is ignored."""
        asked = read_object(text)
        if asked is not None:
            self._asked, self._sent = asked, None
            self.news.set()

    def follow(self, runtime: Runtime | None) -> None:
        """Follow the topic in this runtime."""
        topic = self._asked.get("topic")
        if runtime is None or not isinstance(topic, str) or topic not in runtime.graph.topics:
            topic = ""
        if (runtime, topic) == (self._runtime, self._topic):
            return
        if self._feed is not None:
            self._feed.follow(None)
            self._feed = None
        self._runtime, self._topic = runtime, topic
        self._kept.clear()
        self._count, self._sent = 0, None
        if runtime is not None and topic:
            is_small = getattr(runtime.graph.topics[topic].type, "plotted", True)
            self._feed = Feed(runtime, _KEPT if is_small else _LARGE_DEPTH)
            self._feed.follow(topic)

    async def offer(self) -> None:
        """Send the names and types of the topics after each change."""
        graph = None if self._runtime is None else self._runtime.graph
        if graph is not self._offered:
            self._offered = graph
            topics = {} if graph is None else {n: one.ros.name for n, one in graph.topics.items()}
            await self.send_text(json.dumps({"topics": topics}))

    async def send_text(self, text: str) -> None:
        await self._send({"type": "websocket.send", "text": text})

    def text(self) -> str:
        """The present answer, if it has changed since the last time; else nothing."""
        feed, asked = self._feed, self._asked
        while feed is not None and (message := feed.take(decode=False)) is not None:
            self._kept.append(message)
            self._count += 1
            while len(self._kept) > 1 and sum(one.nbytes for one in self._kept) > _KEPT_BYTES:
                self._kept.popleft()
        state = self._topic, self._count
        if state == self._sent or not self._topic:
            return ""
        self._sent = state
        first = self._count - len(self._kept) + 1
        answer: dict[str, Any] = {"topic": self._topic, "first": first, "last": self._count}
        try:
            if self._kept:
                answer |= self._described(asked.get("number"), first)
            if isinstance(fields := asked.get("fields"), list):
                answer["rows"] = self._rows([one for one in fields if isinstance(one, str)], first)
        except (RosVisualiseError, ValueError) as error:
            answer["error"] = str(error)
        return json.dumps(answer, allow_nan=False)

    def _described(self, number: Any, first: int) -> dict[str, Any]:
        if type(number) is not int or not first <= number <= self._count:
            number = self._count
        message = self._kept[number - first]
        stamp = str(message.header.stamp_ns)  # more digits than JavaScript's numbers hold
        return {"number": number, "stamp": stamp, "message": tree_of(message)}

    def _rows(self, fields: list[str], first: int) -> list[list[Any]]:
        """Number, stamp and fields of each message, the newest first."""
        rows = []
        for back, message in enumerate(reversed(self._kept)):
            found = as_ros(message)
            numbers = [number_at(path, found) for path in fields[:_MOST_FIELDS]]
            cells = [value if math.isfinite(value) else str(value) for value in numbers]
            rows.append([self._count - back, str(message.header.stamp_ns), *cells])
        return rows
