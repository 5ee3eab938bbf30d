"""The newest of something, as text, for all browsers that show it."""

from __future__ import annotations

import asyncio

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.exchange import exchange, ignore
from ros_visualise.ui.server.gate import Receive, Scope, Send


class Newest:
    """Sends browsers the newest text; a slow one skips those between.

    Attributes:
        path: of its WebSockets.
    """

    def __init__(self, path: str, loop: asyncio.AbstractEventLoop) -> None:
        self.path, self._loop = path, loop
        self._text = ""
        self._news: set[asyncio.Event] = set()

    @property
    def is_watched(self) -> bool:
        """True while a browser shows it."""
        return bool(self._news)

    def show(self, runtime: Runtime | None) -> None:
        """Do nothing: the texts come from elsewhere."""

    def close(self) -> None:
        """Do nothing: it has no thread."""

    def put(self, text: str) -> None:
        """Send another text; from any thread."""
        self._loop.call_soon_threadsafe(self._put, text)

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves; messages from it are ignored."""
        news = asyncio.Event()
        news.set()
        self._news.add(news)
        try:
            await exchange(receive, send, self._send_all(send, news), ignore)
        finally:
            self._news.discard(news)

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
