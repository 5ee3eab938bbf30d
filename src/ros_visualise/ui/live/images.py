"""Images for browsers: encoded once for all, the newest first, as fast as each takes them."""

from __future__ import annotations

import asyncio
import json
import math
import struct
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Image, PointCloud
from ros_visualise.graph import Graph, Member, Node
from ros_visualise.lessons.magnifier import PixelParams, pixel_at
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live import closeup
from ros_visualise.ui.live.closeup import Closeup
from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.live.image_channel import ImageChannel, ImageView, Picture
from ros_visualise.ui.live.previews import Previews, shows_source
from ros_visualise.ui.live.surroundings import Surroundings
from ros_visualise.ui.server.answers import READ_ONLY, Refusal
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.server.pool import Pool
from ros_visualise.ui.shown import detections_of, first_shown

_CREDIT = 2
"""Images of a view that are on their way to a browser at once."""
_MOST_SHOWN, _MOST_CHANNELS = 24, 48
_MOST_PIXELS = 1 << 17
_LETTERS = 300
_MOST_ASKED = 16
_THREADS = 2
_LOOK_S = 0.2
_FARTHEST = 1e7
_REST, _REST_UNTHROTTLED = 2.0, 8.0
"""Seconds of pause for each second of computing while nodes compute too: they come first."""
_ANSWERS: Mapping[str, Callable[[Image, list[float]], Closeup]] = {
    "part": closeup.part,
    "line": closeup.line,
    "histogram": lambda image, _: closeup.histogram(image),
    "png": lambda image, _: closeup.png(image),
}


class ImageHub:
    """The images of a graph; encoded and taken only while a browser shows them."""

    path = "/live/images"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.pool = Pool("image values", _THREADS)
        self._loop = loop
        self._runtime: Runtime | None = None
        self._graph: Graph | None = None
        self._surroundings: Surroundings | None = None
        self._previews: Previews | None = None
        self._channels: dict[ImageView, _Channel] = {}
        self._browsers: set[_Browser] = set()
        self._looking: asyncio.TimerHandle | None = None
        self.topics = json.dumps({"topics": []})

    def show(self, runtime: Runtime | None) -> None:
        """Serve this graph from now on, or none; from any thread."""
        surroundings = None if runtime is None else Surroundings(runtime)
        self._loop.call_soon_threadsafe(self._follow, runtime, surroundings)

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one browser the images that it shows, until it leaves.

        It sends ``{"show": {KEY: VIEW and "size"}}`` for all that it shows, ``{"got": KEY}`` for
        each image that it has drawn, and ``{"ask": NUMBER, "key": KEY, "what": ..., "at": [...]}``
        for values of the image it has, or to choose a pixel of it.
        """
        visit: Visit = scope["state"]["visit"]
        browser = _Browser(self, send, visit)
        self._browsers.add(browser)
        if self._looking is None:
            self._look()
        try:
            await exchange(receive, send, browser.send_all(), browser.hear)
        finally:
            self._browsers.discard(browser)
            browser.leave()

    def close(self) -> None:
        """End all threads, without waiting."""
        self.show(None)
        self.pool.close()

    def join(self, shown: _Shown) -> None:
        """Give a browser the channel of a view, if the graph has its topics."""
        view = shown.view
        if view not in self._channels and self._runtime and self._has(view):
            if len(self._channels) >= _MOST_CHANNELS:
                return
            self._channels[view] = _Channel(self, view)
        shown.channel = self._channels.get(view)
        if shown.channel is not None:
            shown.channel.note(shown)

    def leave(self, shown: _Shown) -> None:
        """Take a browser from a channel; without any, it ends."""
        channel, shown.channel = shown.channel, None
        if channel is not None and channel.forget(shown):
            self._channels.pop(shown.view).maker.close()

    def start(self, view: ImageView, put: Callable[[Picture], None]) -> ImageChannel:
        """Make the images of a view; ``put`` is called on the page's loop."""
        assert self._runtime is not None
        assert self._surroundings is not None
        runtime, loop = self._runtime, self._loop

        def deliver(picture: Picture) -> None:
            loop.call_soon_threadsafe(partial(put, picture))

        return ImageChannel(view, runtime, self._surroundings, deliver, partial(_rest, runtime))

    def pick(self, topic: str, image: Image, across: float, down: float) -> None:
        """Choose a pixel for the node of a topic, by shares of the image's width and height."""
        runtime, pixel = self._runtime, pixel_at(image, across, down)
        node = runtime and _publisher(runtime.graph, topic)
        if runtime and node and pixel and isinstance(node.params, PixelParams):
            x, y = (max(value, 0) for value in pixel)
            runtime.parameters[node.name].update({"x": x, "y": y})

    def _look(self) -> None:
        """Follow a graph that has changed, while there are browsers."""
        self._looking = None
        if not self._browsers:
            return
        if self._runtime is not None and self._runtime.graph is not self._graph:
            if self._surroundings is not None:
                self._surroundings.follow(self._runtime.graph)
            self._follow(self._runtime, self._surroundings)
        self._looking = self._loop.call_later(_LOOK_S, self._look)

    def _follow(self, runtime: Runtime | None, surroundings: Surroundings | None) -> None:
        if runtime is not self._runtime and self._surroundings is not None:
            self._surroundings.close()
        is_same = runtime is self._runtime
        if not is_same:
            self._make_previews(runtime)
        self._runtime, self._surroundings = runtime, surroundings
        self._graph = None if runtime is None else runtime.graph
        self.topics = json.dumps({"topics": _offers(self._graph) if self._graph else []})
        shown = [one for browser in self._browsers for one in browser.shown.values()]
        for one in shown:
            if not (is_same and self._has(one.view)):
                self.leave(one)
        for browser in self._browsers:
            browser.follow()

    def _make_previews(self, runtime: Runtime | None) -> None:
        if self._previews is not None:
            self._previews.close()
        self._previews = None
        if runtime is not None and runtime.playback is not None:
            show, loop = self._preview, self._loop

            def deliver(image: Image) -> None:
                loop.call_soon_threadsafe(partial(show, image))

            self._previews = Previews(runtime.playback, deliver, lambda: bool(self._channels))

    def _preview(self, image: Image) -> None:
        topics = set() if self._graph is None else shows_source(self._graph)
        for view, channel in self._channels.items():
            if view.topic in topics and not view.minus:
                channel.maker.preview(image)

    def _has(self, view: ImageView) -> bool:
        assert self._graph is not None
        kinds = {name: topic.type for name, topic in self._graph.topics.items()}
        return (
            kinds.get(view.topic) is Image
            and (not view.minus or kinds.get(view.minus) is Image)
            and (not view.cloud or kinds.get(view.cloud) is PointCloud)
        )


class _Channel:
    """The images of one view, and who shows them; belongs to the page's loop."""

    def __init__(self, hub: ImageHub, view: ImageView) -> None:
        self.picture: Picture | None = None
        self._shown: set[_Shown] = set()
        self.maker = hub.start(view, self._put)

    def _put(self, picture: Picture) -> None:
        self.picture = picture
        for shown in self._shown:
            shown.browser.wake()

    def note(self, shown: _Shown) -> None:
        """Note what a browser shows and can take."""
        self._shown.add(shown)
        self._tell()

    def forget(self, shown: _Shown) -> bool:
        """Forget a browser; true if it was the last one."""
        self._shown.discard(shown)
        self._tell()
        return not self._shown

    def _tell(self) -> None:
        maker, wanting = self.maker, [one for one in self._shown if not one.held]
        before = maker.size, maker.is_ready
        maker.size = max((one.size for one in wanting), default=maker.size)
        maker.is_ready = any(one.credit > 0 for one in wanting)
        if (maker.size, maker.is_ready) != before:
            maker.changed.set()


class _Shown:
    """A view in one browser: its size, the last image sent, and how many more it can take."""

    def __init__(self, browser: _Browser, key: str, view: ImageView) -> None:
        self.browser, self.key, self.view = browser, key, view
        self.channel: _Channel | None = None
        self.size, self.number, self.credit = 0, 0, _CREDIT
        self.held = False
        self.image: Image | None = None


class _Browser:
    def __init__(self, hub: ImageHub, send: Send, visit: Visit) -> None:
        self.shown: dict[str, _Shown] = {}
        self._hub, self._send, self._visit = hub, send, visit
        self._asked: deque[Mapping[str, Any]] = deque(maxlen=_MOST_ASKED)
        self._news, self._questions = asyncio.Event(), asyncio.Event()
        self._topics = ""

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
        """Show the images of another graph."""
        for shown in self.shown.values():
            if shown.channel is None:
                shown.number, shown.credit, shown.image = 0, _CREDIT, None
                self._hub.join(shown)
        self.wake()

    def _show(self, wanted: Mapping[str, Any]) -> None:
        views = {key: (_view(one), one) for key, one in list(wanted.items())[:_MOST_SHOWN]}
        for key, shown in list(self.shown.items()):
            if key not in views or views[key][0] != shown.view:
                self._hub.leave(self.shown.pop(key))
        for key, (view, asked) in views.items():
            if view is None or len(key) > _LETTERS:
                continue
            shown = self.shown.setdefault(key, _Shown(self, key, view))
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


def _offers(graph: Graph) -> list[Mapping[str, Any]]:
    """The topics of images, those first that each node shows first, with what may be drawn."""
    kinds = {name: topic.type for name, topic in graph.topics.items()}
    first = [first_shown(graph, member) for member in graph.members if not member.aside]
    images = [name for name, kind in kinds.items() if kind is Image]
    clouds = [name for name, kind in kinds.items() if kind is PointCloud]
    return [
        {
            "topic": topic,
            "clouds": clouds if _is_of_camera(_publisher(graph, topic)) else [],
            "boxes": bool(detections_of(graph, topic)),
            "picks": isinstance(getattr(_publisher(graph, topic), "params", None), PixelParams),
        }
        for topic in dict.fromkeys([*first, *images])
        if topic
    ]


def _publisher(graph: Graph, topic: str) -> Member | None:
    """The node that publishes a topic."""
    return next((one for one in graph.members if topic in one.outputs.values()), None)


def _is_of_camera(node: Member | None) -> bool:
    """False for images that a node draws of numbers, over which no clouds can be drawn."""
    taken = () if node is None else node.type.inputs.values()
    return not (taken and isinstance(node, Node)) or Image in taken


def _rest(runtime: Runtime) -> float:
    """Seconds of pause for each second of computing."""
    playback = runtime.playback
    if playback is None or playback.state.playing:
        is_unthrottled = playback is not None and playback.state.rate == 0
        return _REST_UNTHROTTLED if is_unthrottled else _REST
    return 0.0
