"""Things on the map: the newest GeoJSON of each topic, sent at once where it has changed.

A browser gets ``{"topic": TOPIC, "geojson": OBJECT}``, null where a topic ended or its text is no
GeoJSON, and once ``{"tiles": TEMPLATE}``, the address of tiles that the command line names.
"""

from __future__ import annotations

import asyncio
import json

from ros_visualise.data import Text
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.feed import Feed
from ros_visualise.ui.live.exchange import exchange, ignore, read_object
from ros_visualise.ui.server.gate import Receive, Scope, Send

_ENDING = "geojson"
_PERIOD_S = 0.1
_MOST_TOPICS = 20
_LONGEST = 8 << 20  # characters


class MapHub:
    """Shows browsers the things that topics with names that end in ``geojson`` place on the Earth.

    Args:
        tiles: template of addresses with {z}, {x} and {y}; empty: none.
    """

    path = "/live/map"

    def __init__(self, tiles: str = "") -> None:
        self.tiles = tiles
        self._runtime: Runtime | None = None

    def show(self, runtime: Runtime | None) -> None:
        """Show the topics of this runtime from now on, or none; from any thread."""
        self._runtime = runtime

    def close(self) -> None:
        """End it: there is no thread."""
        self._runtime = None

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves."""
        feeds: dict[str, Feed] = {}
        try:
            await exchange(receive, send, self._send_all(send, feeds), ignore)
        finally:
            for feed in feeds.values():
                feed.follow(None)

    async def _send_all(self, send: Send, feeds: dict[str, Feed]) -> None:
        async def send_json(**message: object) -> None:
            await send({"type": "websocket.send", "text": json.dumps(message)})

        await send_json(tiles=self.tiles)
        runtime: Runtime | None = None
        sent: dict[str, str] = {}
        while True:
            topics = _topics(self._runtime.graph) if self._runtime else []
            gone = [topic for topic in feeds if topic not in topics or runtime is not self._runtime]
            for topic in gone:
                feeds.pop(topic).follow(None)
                sent.pop(topic, None)
                await send_json(topic=topic, geojson=None)
            runtime = self._runtime
            for topic in topics:
                if runtime is not None and topic not in feeds:
                    feeds[topic] = Feed(runtime)
                    feeds[topic].follow(topic)
            for topic, feed in feeds.items():
                message = feed.take()
                if isinstance(message, Text) and message.text != sent.get(topic):
                    text = sent[topic] = message.text
                    found = read_object(text) if len(text) <= _LONGEST else None
                    await send_json(topic=topic, geojson=found)
            await asyncio.sleep(_PERIOD_S)


def _topics(graph: Graph) -> list[str]:
    kinds = graph.topics.items()
    found = [name for name, one in kinds if one.type is Text and name.endswith(_ENDING)]
    return found[:_MOST_TOPICS]
