"""The graph as browsers need it to offer panels, topics, parameters and actions."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from typing import Any

from ros_visualise.core.params import specs
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.exchange import exchange
from ros_visualise.ui.server.gate import Receive, Scope, Send
from ros_visualise.ui.shell.layouts import standard_layout

_PERIOD_S = 0.25


class OfferedHub:
    """Tells browsers of the graph, of its standard layout, and of the page's title.

    Attributes:
        title: of the browsers' tabs.
        is_seen: a browser has had its panels.
        wanted: a layout that a person gave, in place of a standard one, or None.
    """

    path = "/live/offered"

    def __init__(self, title: str) -> None:
        self.title, self.is_seen = title, False
        self.wanted: object = None
        self._runtime: Runtime | None = None
        self._made: tuple[Graph | None, str] | None = None
        self._text = ""

    def show(self, runtime: Runtime | None) -> None:
        """Tell of this graph from now on."""
        self._runtime = runtime

    def close(self) -> None:
        """Do nothing: it has no thread."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves; it sends a message when its panels are there."""
        await exchange(receive, send, self._send_all(send), self._hear)

    def _hear(self, _: str) -> None:
        self.is_seen = True

    @property
    def standard(self) -> object:
        """The standard layout of the present graph."""
        if self.wanted is not None:
            return self.wanted
        return standard_layout(None if self._runtime is None else self._runtime.graph)

    async def _send_all(self, send: Send) -> None:
        sent = ""
        while True:
            if self._present != sent:
                sent = self._text
                await send({"type": "websocket.send", "text": sent})
            await asyncio.sleep(_PERIOD_S)

    @property
    def _present(self) -> str:
        graph = None if self._runtime is None else self._runtime.graph
        if self._made is None or self._made[0] is not graph or self._made[1] != self.title:
            self._made = graph, self.title
            self._text = json.dumps({"title": self.title, "layout": self.standard, **offer(graph)})
        return self._text


def offer(graph: Graph | None) -> Mapping[str, Any]:
    """Topics with their types; parameters and actions with their nodes and what they do."""
    if graph is None:
        return {"topics": [], "parameters": [], "actions": []}
    topics = [[name, topic.ros.name] for name, topic in sorted(graph.topics.items())]
    parameters = [[one.name, p.name, p.help] for one in graph.members for p in specs(one.params)]
    actions = [
        [one.name, name, help] for one in graph.members for name, help in one.type.actions.items()
    ]
    return {"topics": topics, "parameters": parameters, "actions": actions}
