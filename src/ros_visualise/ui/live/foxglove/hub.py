"""Shared by all viewers: the graph that is shown, its channels and services, and their feeds."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.encoding import TopicDeclaration
from ros_visualise.ui.live.foxglove.feed import ChannelFeed, Encoded, LockedEncoder
from ros_visualise.ui.live.foxglove.messages import SUBPROTOCOLS
from ros_visualise.ui.live.foxglove.viewer import FoxgloveViewer
from ros_visualise.ui.live.played import PlaybackLine, playback_line
from ros_visualise.ui.server.answers import Refusal
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.server.pool import Pool

log = logging.getLogger(__name__)

_MOST_VIEWERS = 32
_THREADS = 4
_DEPTH, _LARGE_DEPTH = 100, 2  # messages that wait to be encoded


class OfferedGraph(NamedTuple):
    """A graph as viewers see it.

    Attributes:
        session: another one for each graph that is opened.
        channels: number -> topic, and its declaration for viewers.
        services: number -> node and action.
        line: its playback; None if it is live.
    """

    session: str
    runtime: Runtime
    graph: Graph
    channels: Mapping[int, tuple[str, Mapping[str, Any]]]
    services: Mapping[int, tuple[str, str]]
    line: PlaybackLine | None


class FoxgloveHub:
    """Serves viewers by the Foxglove WebSocket protocol.

    Messages are encoded only while a viewer subscribes to their topic, once for all viewers.

    Attributes:
        pool: threads for what may take long.
    """

    path = "/foxglove"

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.pool = Pool("foxglove", _THREADS)
        self._loop = loop
        self._runtime: Runtime | None = None
        self._session = ""
        self._offered: OfferedGraph | None = None
        self._offering = asyncio.Lock()
        self._encoder: LockedEncoder | None = None
        self._numbers: dict[Any, int] = {}
        self._feeds: dict[str, ChannelFeed] = {}
        self._followers: dict[str, set[FoxgloveViewer]] = {}
        self._viewers: set[FoxgloveViewer] = set()
        self._undeclared: set[str] = set()

    def show(self, runtime: Runtime | None) -> None:
        """Offer the graph of this runtime from now on, or none; from any thread."""
        self._runtime, self._session = runtime, str(time.time_ns())
        self._loop.call_soon_threadsafe(self._end_feeds)

    def close(self) -> None:
        """End all feeds and threads."""
        self.show(None)
        self.pool.close()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one viewer until it leaves.

        Raises:
            Refusal: it speaks another protocol, or there are too many.
        """
        chosen = next((one for one in scope["subprotocols"] if one in SUBPROTOCOLS), None)
        if chosen is None:
            raise Refusal(f"unsupported subprotocol; use {' or '.join(SUBPROTOCOLS)}")
        if len(self._viewers) >= _MOST_VIEWERS:
            raise Refusal(f"busy: {_MOST_VIEWERS} viewers are connected; try again later", 503)
        visit: Visit = scope["state"]["visit"]
        viewer = FoxgloveViewer(self, chosen, visit.is_viewer)
        self._viewers.add(viewer)
        try:
            await receive()  # the request to connect
            await send({"type": "websocket.accept", "subprotocol": chosen})
            await viewer.run(receive, send)
        finally:
            self._viewers.discard(viewer)
            for topic in list(self._followers):
                self.leave(topic, viewer)

    async def offered(self) -> OfferedGraph | None:
        """The present graph; None while nothing is shown."""
        async with self._offering:
            runtime, session, old = self._runtime, self._session, self._offered
            if runtime is None:
                self._offered = None
            elif old is None or old.session != session or old.graph is not runtime.graph:
                graph = runtime.graph
                self._offered = await self.pool.do(partial(self._offer, session, runtime, graph))
                self._end_feeds()
        return self._offered

    def follow(self, topic: str, viewer: FoxgloveViewer) -> None:
        """Send a viewer the messages of a topic of the offered graph, beginning with the last."""
        if self._offered is None:
            return
        self._followers.setdefault(topic, set()).add(viewer)
        if topic not in self._feeds:
            self._begin_feed(self._offered, topic)
        elif (last := self._feeds[topic].last) is not None:
            viewer.put(topic, last)

    def leave(self, topic: str, viewer: FoxgloveViewer) -> None:
        """End that; without followers the topic is no longer subscribed to."""
        followers = self._followers.get(topic, set())
        followers.discard(viewer)
        if not followers:
            self._followers.pop(topic, None)
            if topic in self._feeds:
                self._feeds.pop(topic).close()

    def feed(self, topic: str) -> ChannelFeed | None:
        """The feed of a topic; None if it has no followers."""
        return self._feeds.get(topic)

    def _end_feeds(self) -> None:
        """End the feeds of an earlier graph, and begin those with followers anew."""
        for feed in self._feeds.values():
            feed.close()
        self._feeds = {}
        if self._offered is None or self._runtime is not self._offered.runtime:
            return
        topics = {topic for topic, _ in self._offered.channels.values()}
        for topic in self._followers.keys() & topics:
            self._begin_feed(self._offered, topic)

    def _begin_feed(self, offered: OfferedGraph, topic: str) -> None:
        assert self._encoder is not None
        spec = offered.graph.topics.get(topic)
        depth = _DEPTH if spec is None or spec.type.plotted else _LARGE_DEPTH
        subscribe = partial(offered.runtime.subscribe, topic, depth)
        self._feeds[topic] = ChannelFeed(topic, subscribe, self._encoder, self._give)

    def _give(self, feed: ChannelFeed, encoded: Encoded) -> None:
        self._loop.call_soon_threadsafe(self._hand_on, feed, encoded)

    def _hand_on(self, feed: ChannelFeed, encoded: Encoded) -> None:
        feed.release()
        if self._feeds.get(feed.topic) is feed:
            if not encoded.log_ns:
                encoded = encoded._replace(log_ns=self._now_ns())
            feed.last = encoded
            for viewer in self._followers.get(feed.topic, ()):
                viewer.put(feed.topic, encoded)

    def _now_ns(self) -> int:
        line = None if self._offered is None else self._offered.line
        return time.time_ns() if line is None else line.now_ns

    def _offer(self, session: str, runtime: Runtime, graph: Graph) -> OfferedGraph:
        self._encoder = self._encoder or LockedEncoder()
        types = {name: topic.ros for name, topic in graph.topics.items()}
        diagnostics = runtime.diagnostic_topics
        types |= {name: TopicType(kind.type_name) for name, kind in diagnostics.items()}
        channels = {}
        for topic, kind in types.items():
            if (declared := self._declare(topic, kind)) is not None:
                number = self._number((topic, declared.name, declared.text))
                channels[number] = topic, _advert(number, topic, declared)
        services = {
            self._number((member.name, action)): (member.name, action)
            for member in graph.members
            for action in member.type.actions
        }
        line = playback_line(graph, runtime.playback)
        return OfferedGraph(session, runtime, graph, channels, services, line)

    def _declare(self, topic: str, kind: TopicType) -> TopicDeclaration | None:
        assert self._encoder is not None
        try:
            return self._encoder.declare(kind)
        except DamagedMessage as error:
            if topic not in self._undeclared:
                self._undeclared.add(topic)
                log.warning("foxglove: %s is not offered: %s", topic, error)
            return None

    def _number(self, key: Any) -> int:
        """A number that stays with a channel or service and all that defines it."""
        return self._numbers.setdefault(key, len(self._numbers) + 1)


def _advert(number: int, topic: str, declared: TopicDeclaration) -> Mapping[str, Any]:
    return {
        "id": number,
        "topic": topic,
        "encoding": "cdr",
        "schemaName": declared.name,
        "schema": declared.text,
        "schemaEncoding": "ros2msg",
    }
