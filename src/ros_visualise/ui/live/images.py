"""Images for browsers: encoded once for all, the newest first, as fast as each takes them."""

from __future__ import annotations

import asyncio
import json
import struct
from collections.abc import Mapping
from typing import Any

import cv2

from ros_visualise.data import Pixels
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.server.gate import Receive, Scope, Send

_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
_CREDIT = 2
"""Images of a panel that are on their way to a browser at once."""
_MOST_SHOWN, _MOST_PIXELS = 64, 4096


class ImageChannel:
    """The newest image of one panel.

    Attributes:
        name: that of the panel.
        size: longer side of the image in the largest browser that shows it, pixels; 0 without any.
        is_ready: whether a browser can take another image now.
    """

    def __init__(self, name: str, loop: asyncio.AbstractEventLoop) -> None:
        self.name, self.size, self.is_ready = name, 0, False
        self._loop = loop
        self._packet, self._number = b"", 0
        self._shown: dict[_Browser, _Shown] = {}

    def show(self, rgb: Pixels) -> None:
        """Encode an image and send it; from any thread."""
        data = cv2.imencode(".jpg", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), _JPEG)[1].tobytes()
        self._loop.call_soon_threadsafe(self._put, data)

    def _put(self, packet: bytes) -> None:
        self._packet, self._number = packet, self._number + 1
        for browser in self._shown:
            browser.wake()

    def _note(self, browser: _Browser, shown: _Shown | None) -> None:
        """Note what a browser shows and can take."""
        if shown is None:
            self._shown.pop(browser, None)
        else:
            self._shown[browser] = shown
        self.size = max((one.size for one in self._shown.values()), default=0)
        self.is_ready = any(one.credit > 0 for one in self._shown.values())


class _Shown:
    """A panel in one browser: its size, the last image sent, and how many more it can take."""

    def __init__(self, channel: ImageChannel) -> None:
        self.channel = channel
        self.size, self.number, self.credit = 0, 0, _CREDIT


class ImageHub:
    """The images of all panels, by the panels' names."""

    path = "/live/images"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._channels: dict[str, ImageChannel] = {}

    def channel(self, name: str) -> ImageChannel:
        """The channel of a panel; a new panel of the same name continues it."""
        return self._channels.setdefault(name, ImageChannel(name, self._loop))

    def show(self, runtime: Runtime | None) -> None:
        """Do nothing: the panels follow the graph."""

    def close(self) -> None:
        """Do nothing: it has no thread."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one browser the images that it shows, until it leaves.

        It sends ``{"show": {PANEL: SIZE}}`` for all that it shows, and ``{"got": PANEL}`` for each
        image that it has drawn.
        """
        browser = _Browser(self._channels, send)
        try:
            await exchange(receive, send, browser.send_all(), browser.hear)
        finally:
            browser.leave()


class _Browser:
    def __init__(self, channels: Mapping[str, ImageChannel], send: Send) -> None:
        self._channels, self._send = channels, send
        self._shown: dict[str, _Shown] = {}
        self._news = asyncio.Event()

    def wake(self) -> None:
        self._news.set()

    def hear(self, text: str) -> None:
        """Handle a message; anything else than those that our pages send is ignored."""
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            return
        if not isinstance(message, dict):
            return
        name, sizes = message.get("got"), message.get("show")
        if isinstance(sizes, dict):
            self._show(sizes)
        elif isinstance(name, str) and name in self._shown:
            shown = self._shown[name]
            shown.credit = min(shown.credit + 1, _CREDIT)
            shown.channel._note(self, shown)
            self.wake()

    def leave(self) -> None:
        self._show({})

    def _show(self, sizes: Mapping[str, Any]) -> None:
        wanted = {
            name: size
            for name, size in list(sizes.items())[:_MOST_SHOWN]
            if name in self._channels and type(size) is int and 0 < size <= _MOST_PIXELS
        }
        for name in self._shown.keys() - wanted.keys():
            self._shown.pop(name).channel._note(self, None)
        for name, size in wanted.items():
            shown = self._shown.setdefault(name, _Shown(self._channels[name]))
            shown.size = size
            shown.channel._note(self, shown)
        self.wake()

    async def send_all(self) -> None:
        """Send the newest images, the panel that waited longest first."""
        while True:
            await self._news.wait()
            self._news.clear()
            for name, shown in list(self._shown.items()):
                channel = shown.channel
                if shown.credit <= 0 or shown.number == channel._number:
                    continue
                shown.number, shown.credit = channel._number, shown.credit - 1
                channel._note(self, shown)
                await self._send({"type": "websocket.send", "bytes": packet(name, channel._packet)})


def packet(name: str, jpeg: bytes) -> bytes:
    """An image as it is sent: the length of the panel's name, the name, and the JPEG."""
    encoded = name.encode()
    return struct.pack("<H", len(encoded)) + encoded + jpeg
