"""Images for browsers: encoded once for all, the newest first, as fast as each takes them."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from ros_visualise.data import Image, PointCloud
from ros_visualise.graph import Graph, Member, Node
from ros_visualise.lessons.magnifier import PixelParams, pixel_at
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.live.image_browser import ImageBrowser, Shown
from ros_visualise.ui.live.image_channel import ImageChannel, ImageView, Picture
from ros_visualise.ui.live.previews import Previews, shows_source
from ros_visualise.ui.live.space.shown import ShownSpace
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.server.pool import Pool
from ros_visualise.ui.shown import detections_of, first_shown

_MOST_CHANNELS = 48
_THREADS = 2
_LOOK_S = 0.2
_REST, _REST_UNTHROTTLED = 2.0, 8.0
"""Seconds of pause for each second of computing while nodes compute too: they come first."""


class ImageHub:
    """The images of a graph; encoded and taken only while a browser shows them.

    Args:
        space: returns the 3D view, for what is drawn over images.
    """

    path = "/live/images"

    def __init__(self, loop: asyncio.AbstractEventLoop, space: ShownSpace) -> None:
        self.pool = Pool("image values", _THREADS)
        self._loop = loop
        self._runtime: Runtime | None = None
        self._graph: Graph | None = None
        self._space = space
        self._previews: Previews | None = None
        self._channels: dict[ImageView, _Channel] = {}
        self._browsers: set[ImageBrowser] = set()
        self._looking: asyncio.TimerHandle | None = None
        self.topics = json.dumps({"topics": []})

    @property
    def is_shown(self) -> bool:
        """True while a browser shows images."""
        return any(browser.shown for browser in list(self._browsers))

    def show(self, runtime: Runtime | None) -> None:
        """Serve this graph from now on, or none; from any thread."""
        self._loop.call_soon_threadsafe(self._follow, runtime)

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send one browser the images that it shows, until it leaves.

        It sends ``{"show": {KEY: VIEW and "size"}}`` for all that it shows, ``{"got": KEY}`` for
        each image that it has drawn, and ``{"ask": NUMBER, "key": KEY, "what": ..., "at": [...]}``
        for values of the image it has, or to choose a pixel of it.
        """
        visit: Visit = scope["state"]["visit"]
        browser = ImageBrowser(self, send, visit)
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

    def join(self, shown: Shown) -> None:
        """Give a browser the channel of a view, if the graph has its topics."""
        view = shown.view
        if view not in self._channels and self._runtime and self._has(view):
            if len(self._channels) >= _MOST_CHANNELS:
                return
            self._channels[view] = _Channel(self, view)
        shown.channel = self._channels.get(view)
        if shown.channel is not None:
            shown.channel.note(shown)

    def leave(self, shown: Shown) -> None:
        """Take a browser from a channel; without any, it ends."""
        channel = None if shown.channel is None else self._channels.get(shown.view)
        shown.channel = None
        if channel is not None and channel.forget(shown):
            self._channels.pop(shown.view).maker.close()

    def start(self, view: ImageView, put: Callable[[Picture], None]) -> ImageChannel:
        """Make the images of a view; ``put`` is called on the page's loop."""
        assert self._runtime is not None
        runtime, loop = self._runtime, self._loop

        def deliver(picture: Picture) -> None:
            loop.call_soon_threadsafe(partial(put, picture))

        return ImageChannel(view, runtime, self._space, deliver, partial(_rest, runtime))

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
            self._follow(self._runtime)
        for browser in self._browsers:
            browser.follow()  # there may be room for a channel by now
        self._looking = self._loop.call_later(_LOOK_S, self._look)

    def _follow(self, runtime: Runtime | None) -> None:
        is_same = runtime is self._runtime
        if not is_same:
            self._make_previews(runtime)
        self._runtime = runtime
        self._graph = None if runtime is None else runtime.graph
        if self._graph is not None:  # else the page ends, or shows another one in a moment
            self.topics = json.dumps({"topics": _offers(self._graph)})
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
        self._shown: set[Shown] = set()
        self.maker = hub.start(view, self._put)

    def _put(self, picture: Picture) -> None:
        self.picture = picture
        for shown in self._shown:
            shown.browser.wake()

    def note(self, shown: Shown) -> None:
        """Note what a browser shows and can take."""
        self._shown.add(shown)
        self._tell()

    def forget(self, shown: Shown) -> bool:
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
