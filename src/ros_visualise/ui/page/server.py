"""The page's web server: our answers, live data and uploads, behind the gate."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Sequence

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.clock import PageClock
from ros_visualise.ui.live.foxglove.hub import FoxgloveHub
from ros_visualise.ui.live.foxglove.messages import SUBPROTOCOLS
from ros_visualise.ui.live.hub import Hub
from ros_visualise.ui.live.images import ImageHub
from ros_visualise.ui.live.messages import MessageHub
from ros_visualise.ui.live.monitor import MonitorHub
from ros_visualise.ui.live.plots import PlotHub
from ros_visualise.ui.live.rewinding import Rewinder
from ros_visualise.ui.live.space.hub import SpaceHub
from ros_visualise.ui.live.topics import TopicsHub
from ros_visualise.ui.parts import PARTS, part
from ros_visualise.ui.server.access import AccessRules
from ros_visualise.ui.server.answers import HEADER, READ_ONLY, Answer, BrowserQuery, Refusal
from ros_visualise.ui.server.door import listen
from ros_visualise.ui.server.gate import (
    Disconnected,
    Gate,
    Receive,
    Scope,
    Send,
    Visit,
    send_answer,
)
from ros_visualise.ui.server.host import PageHost, page_loop
from ros_visualise.ui.server.tiles import TILES, TileFile
from ros_visualise.ui.server.uploads import UPLOAD, Pieces
from ros_visualise.ui.shell import Shell
from ros_visualise.ui.shell.application import NICEGUI, application
from ros_visualise.ui.shell.offered import OfferedHub

Answers = Callable[[BrowserQuery, bool], Awaitable[Answer | None]]
Receiver = Callable[[BrowserQuery, Pieces], Awaitable[None]]


async def _nothing(*_: object) -> None:
    return None


class PageServer:
    """Serves the page from the start; it checks every request.

    Args:
        title: of the browser's tab.
        flag: the form of a command-line option, for hints, with a name and a value to fill in.
        answer: answers a query, given whether it is read-only; None leaves it to the page.
        receive: takes the connections that send a file.
        more: further hubs.

    Attributes:
        images: those of its panels.
        topics: the figures of its topics.
        space: its 3D view.
        shell: what surrounds them.
        clock: that of the timeline.
        offered: what browsers know of the graph.
        tiles: those of the map, if they are of a file.
        rewinder: the graph that is shown, if it is live.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """

    def __init__(
        self,
        host: str,
        port: int,
        title: str,
        rules: AccessRules,
        flag: str = "--{} {}",
        answer: Answers = _nothing,
        receive: Receiver = _nothing,
        more: Sequence[Hub] = (),
    ) -> None:
        self._answer, self._receive = answer, receive
        listening = listen(host, port, flag)
        self.space = SpaceHub(page_loop())
        self.images = ImageHub(page_loop(), lambda: self.space.shown)
        self.topics = TopicsHub(page_loop())
        self.clock = PageClock()
        self.offered = OfferedHub(title)
        self.shell = Shell(self.offered)
        own: list[Hub] = [
            self.space,
            self.offered,
            self.images,
            self.topics,
            self.clock,
            PlotHub(page_loop()),
        ]
        own += [MessageHub(), MonitorHub(), FoxgloveHub(page_loop())]
        self._hubs = {hub.path: hub for hub in (*own, *more)}
        self.tiles: TileFile | None = None
        self.rewinder: Rewinder | None = None
        self._nicegui = application()
        self._gate = Gate(self._serve, rules)
        self.host = PageHost(self._gate, listening)

    def show(self, runtime: Runtime | None) -> None:
        """Serve this graph from now on, or none."""
        if self.rewinder is not None:
            self.rewinder.close()
        self.rewinder = None
        if runtime is not None and runtime.graph.live:
            self.rewinder = Rewinder(runtime, lambda: self.clock.is_watched)
        for hub in self._hubs.values():
            is_rewound = isinstance(hub, ImageHub | SpaceHub | MessageHub | PageClock)
            hub.show(self.rewinder if is_rewound and self.rewinder is not None else runtime)

    def close(self) -> None:
        """Stop without waiting for browsers."""
        for hub in self._hubs.values():
            hub.close()
        if self.rewinder is not None:
            self.rewinder.close()
        if self.tiles is not None:
            self.tiles.close()
        self.host.close()

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        query = BrowserQuery(scope["query_string"].decode("latin-1"))
        visit: Visit = scope["state"]["visit"]
        if scope["type"] == "websocket" and UPLOAD in query:
            await self._upload(query, visit, receive, send)
            return
        path = scope["path"].removeprefix(scope["root_path"]) or "/"
        if scope["type"] == "http" and path == "/":
            answer = await self._ask(query, scope, visit)
            if answer is not None:
                visit.hold(len(answer.body))
                await send_answer(scope, send, answer)
                return
        if scope["type"] == "websocket" and not path.startswith(NICEGUI):
            await self._connect(path, scope, receive, send)
        elif path.startswith(TILES) and self.tiles is not None:
            tile = await asyncio.to_thread(self.tiles.answer, path.removeprefix(TILES))
            visit.hold(len(tile.body))
            await send_answer(scope, send, tile)
        elif path.startswith(PARTS):
            await send_answer(scope, send, part(path.removeprefix(PARTS)))
        elif path == "/" or path.startswith(NICEGUI):
            scope["path"] = scope["root_path"] + path  # with its last /
            scope["state"]["shell"] = self.shell
            await self._nicegui(scope, receive, send)
        else:
            raise Refusal("no such page", 404)

    async def _connect(self, path: str, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a WebSocket; report to other paths where viewers connect."""
        if path in self._hubs:
            await self._hubs[path].serve(scope, receive, send)
            return
        hint = f"for Foxglove, use the printed address with ws://, and append {FoxgloveHub.path}"
        if not set(SUBPROTOCOLS).isdisjoint(scope["subprotocols"]):
            self._gate.report_once(f"page: {hint}")  # viewers do not show the answer
        raise Refusal(f"no WebSocket at this address; {hint}", 404)

    async def _ask(self, query: BrowserQuery, scope: Scope, visit: Visit) -> Answer | None:
        own = [value for key, value in scope["headers"] if key == HEADER.lower().encode()]
        if "ask" in query and own != [b"1"]:
            raise Refusal("only pages from this server may send queries", 403)
        return await self._answer(query, visit.is_viewer)

    async def _upload(
        self, query: BrowserQuery, visit: Visit, receive: Receive, send: Send
    ) -> None:
        if visit.is_viewer:
            raise Refusal(READ_ONLY, 403)

        async def next_piece() -> str | bytes:
            message = await receive()
            if message["type"] == "websocket.disconnect":
                raise Disconnected
            return message.get("bytes") or message.get("text") or b""

        await receive()  # the request to connect
        await send({"type": "websocket.accept"})
        await self._receive(query, next_piece)
        await send({"type": "websocket.close"})


def url(host: str, port: int, token: str = "") -> str:
    """The address for a browser on this machine."""
    name = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "::1"}.get(host, host)
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}" + (f"/{token}" if token else "")
