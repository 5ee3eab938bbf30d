"""The newest of several things, as JSON for all browsers."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from typing import Any

from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.server.gate import Receive, Send

Message = Mapping[str, Any]


class LiveBoard:
    """Holds a message for each key, and sends it to all browsers; a slow one skips those between.

    A browser receives lists of messages, beginning with all that the board holds.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._texts: dict[str, str] = {}
        self._visitors: set[Visitor] = set()

    @property
    def is_watched(self) -> bool:
        """True while a browser looks."""
        return bool(self._visitors)

    def put(self, key: str, message: Message) -> None:
        """Hold a message in place of the one under the same key; from any thread."""
        self._call(self._put, key, json.dumps(message, allow_nan=False))

    def keep(self, keys: set[str]) -> None:
        """Drop all messages but those under these keys; from any thread."""
        self._call(self._keep, keys)

    async def serve(
        self, receive: Receive, send: Send, visitor: Visitor, hear: Callable[[str], object]
    ) -> None:
        """Serve one browser until it leaves; ``hear`` is called with each text from it."""
        visitor.waiting.update(self._texts)
        visitor.news.set()
        self._visitors.add(visitor)
        try:
            await exchange(receive, send, visitor.send_all(send), hear)
        finally:
            self._visitors.discard(visitor)

    def tell(self, visitor: Visitor, key: str, message: Message) -> None:
        """Send a message to one browser; from any thread."""
        self._call(visitor.put, key, json.dumps(message, allow_nan=False))

    def _call(self, action: Callable[..., object], *values: Any) -> None:
        self._loop.call_soon_threadsafe(action, *values)

    def _put(self, key: str, text: str) -> None:
        if self._texts.get(key) != text:
            self._texts[key] = text
            for visitor in self._visitors:
                visitor.put(key, text)

    def _keep(self, keys: set[str]) -> None:
        self._texts = {key: text for key, text in self._texts.items() if key in keys}


class Visitor:
    """One browser, and the messages that wait for it."""

    def __init__(self) -> None:
        self.waiting: dict[str, str] = {}
        self.news = asyncio.Event()

    def put(self, key: str, text: str) -> None:
        self.waiting[key] = text
        self.news.set()

    async def send_all(self, send: Send) -> None:
        while True:
            await self.news.wait()
            self.news.clear()
            texts, self.waiting = self.waiting.values(), {}
            await send({"type": "websocket.send", "text": f"[{','.join(texts)}]"})
