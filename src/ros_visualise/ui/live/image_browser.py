"""One browser that shows images: what it asks for, what it is sent, and what it may choose."""

from __future__ import annotations

import asyncio
import json
import math
import struct
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Protocol

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Image
from ros_visualise.ui.live import closeup
from ros_visualise.ui.live.closeup import Closeup
from ros_visualise.ui.live.exchange import read_object
from ros_visualise.ui.live.image_channel import ImageView, Picture
from ros_visualise.ui.server.answers import READ_ONLY, Refusal
from ros_visualise.ui.server.gate import Send, Visit
from ros_visualise.ui.server.pool import Pool

_CREDIT = 2
"""Images of a view that are on their way to a browser at once."""
_MOST_SHOWN, _MOST_ASKED = 24, 16
_MOST_PIXELS = 1 << 17
_LETTERS = 300
_FARTHEST = 1e7
_ANSWERS: Mapping[str, Callable[[Image, list[float]], Closeup]] = {
    "part": closeup.part,
    "line": closeup.line,
    "histogram": lambda image, _: closeup.histogram(image),
    "png": lambda image, _: closeup.png(image),
}


class ViewChannel(Protocol):
    """The images of one view.

    Attributes:
        picture: the newest one.
    """

    picture: Picture | None

    def note(self, shown: Shown) -> None:
        """Take note of the size that a browser shows, and of its credit."""


class Channels(Protocol):
    """Gives browsers their images.

    Attributes:
        pool: threads for what may take long.
        topics: the topics of images, as text.
    """

    pool: Pool
    topics: str

    def join(self, shown: Shown) -> None:
        """Give a browser the channel of a view, if the graph has its topics."""

    def leave(self, shown: Shown) -> None:
        """Take a browser from a channel."""

    def pick(self, topic: str, image: Image, across: float, down: float) -> None:
        """Choose a pixel for the node of a topic, by shares of the image's width and height."""


class Shown:
    """A view in one browser: its size, the last image sent, and how many more it can take."""

    def __init__(self, browser: ImageBrowser, key: str, view: ImageView) -> None:
        self.browser, self.key, self.view = browser, key, view
        self.channel: ViewChannel | None = None
        self.size, self.number, self.credit = 0, 0, _CREDIT
        self.held = False
        self.image: Image | None = None


class ImageBrowser:
    """Sends one browser what it shows; belongs to the page's loop.

    Attributes:
        shown: its views by the keys that it gave them.
    """

    def __init__(self, hub: Channels, send: Send, visit: Visit) -> None:
        self.shown: dict[str, Shown] = {}
        self._hub, self._send, self._visit = hub, send, visit
        self._asked: deque[Mapping[str, Any]] = deque(maxlen=_MOST_ASKED)
        self._news, self._questions = asyncio.Event(), asyncio.Event()
        self._topics = ""

    def wake(self) -> None:
        self._news.set()

    def hear(self, text: str) -> None:
        """Handle a message; anything else than those that our pages send is ignored."""
        message = read_object(text)
        if message is None:
            return
        if isinstance(message.get("show"), dict):
            self._show(message["show"])
        elif (shown := self.shown.get(str(message.get("got")))) is not None:
            shown.credit = min(shown.credit + 1, _CREDIT)
            if shown.channel is not None:
                shown.channel.note(shown)
            self.wake()
        elif "ask" in message:
            self._asked.append(message)
            self._questions.set()

    def leave(self) -> None:
        self._show({})

    def follow(self) -> None:
        """Show images that could not be shown before."""
        for shown in self.shown.values():
            if shown.channel is None:
                shown.number, shown.credit, shown.image = 0, _CREDIT, None
                self._hub.join(shown)
        if self._topics != self._hub.topics:
            self.wake()

    def _show(self, wanted: Mapping[str, Any]) -> None:
        views = {key: (_view(one), one) for key, one in list(wanted.items())[:_MOST_SHOWN]}
        for key, shown in list(self.shown.items()):
            if key not in views or views[key][0] != shown.view:
                self._hub.leave(self.shown.pop(key))
        for key, (view, asked) in views.items():
            if view is None or len(key) > _LETTERS:
                continue
            shown = self.shown.setdefault(key, Shown(self, key, view))
            shown.size, shown.held = asked["size"], asked.get("held") is True
            self._hub.join(shown)
        self.wake()

    async def send_all(self) -> None:
        """Send images and answers."""
        answering = asyncio.ensure_future(self._answer_all())
        try:
            while True:
                if self._topics != self._hub.topics:
                    self._topics = self._hub.topics
                    await self._send({"type": "websocket.send", "text": self._topics})
                await self._send_newest()
                await self._news.wait()
                self._news.clear()
        finally:
            answering.cancel()
            await asyncio.gather(answering, return_exceptions=True)

    async def _send_newest(self) -> None:
        for shown in list(self.shown.values()):
            channel = shown.channel
            picture = channel and channel.picture
            if not (channel and picture) or shown.credit <= 0 or shown.held:
                continue
            if shown.number == picture.number:
                continue
            shown.number, shown.credit = picture.number, shown.credit - 1
            shown.image = picture.image or shown.image
            channel.note(shown)
            await self._give({"key": shown.key, **picture.facts}, picture.jpeg)

    async def _answer_all(self) -> None:
        """Answer questions, one at a time: a browser that asks much slows only itself."""
        while True:
            await self._questions.wait()
            self._questions.clear()
            while self._asked:
                await self._answer(self._asked.popleft())

    async def _answer(self, message: Mapping[str, Any]) -> None:
        number, body = message.get("ask"), b""
        facts: Mapping[str, Any]
        try:
            facts, body = await self._find(message)
        except (RosVisualiseError, Refusal) as error:
            facts, body = {"problem": str(error)}, b""
        except (KeyError, TypeError, ValueError, OverflowError):
            facts = {"problem": "malformed request"}
        except supervision.ERRORS as error:
            supervision.note("image values", error)
            return
        if type(number) is int:
            await self._give({"answer": number, **facts}, body)

    async def _find(self, message: Mapping[str, Any]) -> Closeup:
        """The answer to a question; that to a pick is empty."""
        shown = self.shown.get(str(message.get("key")))
        if shown is None or shown.image is None:
            raise RosVisualiseError("no image yet")
        at = _numbers(message.get("at", []))
        if message.get("what") != "pick":
            answer = _ANSWERS[str(message.get("what"))]
            return await self._hub.pool.do(partial(answer, shown.image, at))
        if self._visit.is_viewer:
            raise Refusal(READ_ONLY, 403)
        await self._hub.pool.do(partial(self._hub.pick, shown.view.topic, shown.image, *at))
        return Closeup({})

    async def _give(self, facts: Mapping[str, Any], body: bytes) -> None:
        await self._send({"type": "websocket.send", "bytes": packet(facts, body)})


def packet(facts: Mapping[str, Any], body: bytes) -> bytes:
    """A message: the length of the facts in JSON, these, and bytes such as a JPEG."""
    encoded = json.dumps(facts, allow_nan=False).encode()
    return struct.pack("<I", len(encoded)) + encoded + body


def _view(asked: Any) -> ImageView | None:
    """The view that a browser asks for; None for anything that is none."""
    if not isinstance(asked, dict):
        return None
    size = asked.get("size")
    names = [asked.get(name, "") for name in ("topic", "minus", "cloud")]
    if type(size) is not int or not 0 < size <= _MOST_PIXELS:
        return None
    if not all(isinstance(name, str) and len(name) <= _LETTERS for name in names):
        return None
    topic, minus, cloud = names
    boxes, stretch = (asked.get(name) is True for name in ("boxes", "stretch"))
    return ImageView(topic, minus, cloud, boxes, stretch)


def _numbers(at: Any) -> list[float]:
    """Up to four finite numbers; raises ValueError for anything else."""
    if not isinstance(at, list) or len(at) > 4:
        raise ValueError("not a list of numbers")
    for value in at:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError("not a number")
        if not (math.isfinite(value) and abs(value) <= _FARTHEST):
            raise ValueError("too large")
    return [float(value) for value in at]
