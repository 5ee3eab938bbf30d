"""The connections of the page's server, each through the gate.

viser 1.1 accepts every request and every kind of message, and makes its server where it cannot be
configured. So that server is given connections of a class of our own, by the option that the
websockets library has for it (``create_connection``).
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.protocol import CONNECTING

from ros_visualise.ui.look.answers import Answer, Refusal
from ros_visualise.ui.page.budget import Client
from ros_visualise.ui.page.gate import MOST_REPORTED, Gate, fetch_of
from ros_visualise.ui.page.inbound import MAX_BYTES
from ros_visualise.ui.page.scripts import complete
from ros_visualise.ui.page.sending import Stalled, send

log = logging.getLogger(__name__)

_Static = Callable[[ServerConnection, Request], Response | None]
_TURNS_TO_ACCEPT = 5
_SEND_BYTES = 128 << 10  # 20 Mbit/s where the way there and back takes 50 ms
_REQUEST_S = 10.0
"""Time limit for a connection to send its request."""
_MOST_SILENT = 100
"""Maximum number of connections without a request; one more ends the oldest."""
_one_at_a_time = Lock()


@contextmanager
def guarded_by(gate: Gate) -> Iterator[None]:
    """Lead the connections of every websockets server made meanwhile through this gate."""
    make = websockets.asyncio.server.serve

    def serve(handler: Any, *args: Any, **settings: Any) -> Any:
        async def handle(connection: Any) -> None:
            gate.viewers += connection.is_viewer
            try:
                if not await gate.takes(connection.query, connection.receive):
                    await handler(connection)
            finally:
                gate.viewers -= connection.is_viewer

        silent: dict[_Connection, None] = {}

        def connect(*args: Any, **settings: Any) -> _Connection:
            return _Connection(gate, silent, *args, **settings)

        gate.is_used = True
        settings |= {"create_connection": connect, "max_size": MAX_BYTES, "open_timeout": None}
        return _Serve(handle, *args, **settings)

    with _one_at_a_time:
        websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = make  # type: ignore[misc]


def viewers(server: viser.ViserServer) -> set[int]:
    """The numbers of the read-only browsers."""
    there = list(server._websock_server._live_connections.items())
    return {number for number, one in there if isinstance(one, _Connection) and one.is_viewer}


class _Serve(websockets.asyncio.server.serve):
    """A server that closes all connections as it ends."""

    async def __aexit__(self, *raised: Any) -> None:
        """Stop accepting, and close once all accepted connections are known.

        The server learns of a connection some turns of the loop later: one that came just before
        the end would stay open.
        """
        loop = asyncio.get_running_loop()
        for listening in self.server.sockets:
            loop.remove_reader(listening.fileno())
        for _ in range(_TURNS_TO_ACCEPT):
            await asyncio.sleep(0)
        for connection, handling in self.server.handlers.items():
            if connection.protocol.state is CONNECTING:
                connection.transport.abort()
                handling.cancel()
        await super().__aexit__(*raised)


class _Connection(ServerConnection):
    """One browser's connection, read-only where ``is_viewer``.

    ``silent`` holds the connections without a request yet, the oldest first.
    """

    def __init__(
        self, gate: Gate, silent: dict[_Connection, None], *args: Any, **settings: Any
    ) -> None:
        super().__init__(*args, **settings)
        self.is_viewer = False
        self._gate, self._silent = gate, silent
        self._reported = 0

    @property
    def query(self) -> str:
        """The query of the requested address."""
        assert self.request is not None
        return self.request.path.partition("?")[2]

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the system's buffer small: what waits for a slow browser gets old."""
        there = transport.get_extra_info("socket")
        there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        super().connection_made(transport)
        self._silent[self] = None
        if len(self._silent) > _MOST_SILENT:
            oldest = next(iter(self._silent))
            del self._silent[oldest]  # at once: many may come before it is lost
            oldest.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._silent.pop(self, None)
        super().connection_lost(exc)

    async def handshake(
        self,
        process_request: Any = None,
        process_response: Any = None,
        server_header: str | None = None,
    ) -> None:
        """Accept a WebSocket, or answer the request and end.

        The library would hold a whole answer for each browser, and drop it after ten seconds.
        """
        asking = [self.request_rcvd, self.connection_lost_waiter]
        await asyncio.wait(asking, timeout=_REQUEST_S, return_when=asyncio.FIRST_COMPLETED)
        self._silent.pop(self, None)
        if self.request is None:
            return
        refused = self._gate.refuse(self.request)
        if refused is None:
            self._enter(self.request)
            if "Upgrade" in self.request.headers:
                refused = self._gate.refuse_connection(self.query, self.is_viewer)
        if refused is not None:
            await self._send(refused)
        elif "Upgrade" in self.request.headers:
            await super().handshake(None, self._complete, None)
        else:
            await self._answer(self.request, process_request)

    async def receive(self) -> str | bytes:
        """The next message, unchecked."""
        return await super().recv()

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that passes the gate."""
        while True:
            data = await super().recv(decode)
            reason = self._gate.refuse_message(data, self.is_viewer)
            if reason is None:
                return data
            if reason and self._reported < MOST_REPORTED:
                self._reported += 1
                log.warning("page: %s", reason)

    def _enter(self, request: Request) -> None:
        rules = self._gate.rules
        self.is_viewer = rules.is_viewer(request.path)
        request.path = rules.inside(request.path)

    async def _answer(self, request: Request, static: _Static) -> None:
        """Answer a query, or else with viser's files."""
        try:
            with self._gate.budget.answer(self._client) as hold:
                answer = await self._own(request)
                if answer is None:
                    answer = self._static(request, static)
                else:
                    hold(len(answer.body))
                await self._send(answer)
        except Refusal as refused:  # of the budget
            await self._send(refused.answer)

    async def _own(self, request: Request) -> Answer | None:
        path, _, query = request.path.partition("?")
        if not query or path not in ("", "/"):
            return None
        return await self._gate.answer(query, request.headers, self.is_viewer)

    def _static(self, request: Request, static: _Static) -> Answer:
        """The answer of viser; browsers share it in memory."""
        found = static(self, request)
        assert found is not None  # for it is no WebSocket
        is_foreign = self._gate.rules.is_foreign(fetch_of(request))
        found = complete(found, self._gate.title, is_foreign, self.is_viewer)
        kept = {"Content-Encoding": found.headers.get("Content-Encoding", "identity")}
        kind = found.headers.get("Content-Type", "text/plain")
        return Answer(bytes(found.body or b""), kind, found.status_code, kept)

    async def _send(self, answer: Answer) -> None:
        try:
            await send(self, answer, self._headers)
        except Stalled as stalled:
            self.transport.abort()
            if str(stalled):
                self._gate.report_once(f"page: {stalled}")

    @property
    def _client(self) -> Client:
        address = self.remote_address
        return Client(str(address[0]) if address else "", self.is_viewer)

    @property
    def _headers(self) -> Headers:
        """Headers by which no other site can embed or read this one."""
        allowed = " ".join(["'self'", *sorted(self._gate.rules.origins)])
        return Headers(
            {
                "Content-Security-Policy": f"frame-ancestors {allowed}",
                "Cross-Origin-Resource-Policy": "same-origin",
                "Referrer-Policy": "no-referrer",
                "X-Content-Type-Options": "nosniff",
            }
        )

    def _complete(self, _: ServerConnection, __: Request, response: Response) -> Response:
        response.headers.update(self._headers)
        return response
