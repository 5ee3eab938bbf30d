"""The gate of the page's server: it checks all requests and messages before viser gets them.

viser 1.1 accepts every request and every kind of message, and makes its server where it cannot be
configured. So that server is given connections of a class of our own, by the option that the
websockets library has for it (``create_connection``).
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from threading import Lock
from typing import Any

import viser
import websockets.asyncio.server
from viser._messages import GuiUpdateMessage
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ros_visualise.ui.look import Answer
from ros_visualise.ui.page.door import Door
from ros_visualise.ui.page.elements import refusal
from ros_visualise.ui.page.inbound import MAX_BYTES, Update, understand
from ros_visualise.ui.page.scripts import complete

log = logging.getLogger(__name__)

_Admit = Callable[[ServerConnection, Request], Any]
Answers = Callable[[str, Mapping[str, str]], Answer | None]
Receiver = Callable[[str, Callable[[], Awaitable[str | bytes]]], Awaitable[bool]]
_MOST_SAID = 5
"""At most so many refused requests are logged, and refused messages of each browser."""
_LONGEST_PATH = 250  # of a name that file systems take
_TURNS_TO_ACCEPT = 5
_SEND_BYTES = 128 << 10  # 20 Mbit/s where the way there and back takes 50 ms
_one_at_a_time = Lock()


class Gate:
    """Checks requests by a door, and messages by the values that the page's elements may have.

    Args:
        door: decides which requests are answered.
        title: of the page.
        answer: gives the answers that are not viser's: called with what an address has after the
            ``?`` and with the headers, on a thread of its own. None: that is viser's to answer.
        receive: takes connections that are not viser's: called with what an address has after the
            ``?`` and with what gives the next message; whether it was one.

    Attributes:
        gui: the elements of the page; None until there are any.
        is_used: whether a server has its connections from here.
    """

    def __init__(
        self, door: Door, title: str, answer: Answers, receive: Receiver | None = None
    ) -> None:
        self.door, self.title, self._answers, self._receive = door, title, answer, receive
        self.gui: viser.GuiApi | None = None
        self.is_used = False
        self._refused: set[str] = set()

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Every websockets server made meanwhile uses connections from here."""
        make = websockets.asyncio.server.serve

        def serve(handler: Any, *args: Any, **settings: Any) -> Any:
            async def handle(connection: Any) -> None:
                if not await self._takes(connection):
                    await handler(connection)

            self.is_used = True
            settings |= {"create_connection": self._connect, "max_size": MAX_BYTES}
            return _Serve(handle, *args, **settings)

        with _one_at_a_time:
            websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
            try:
                yield
            finally:
                websockets.asyncio.server.serve = make  # type: ignore[misc]

    def refuse(self, request: Request) -> str:
        """Why a request is refused; empty if it is allowed."""
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or len(origins) > 1:
            return "a request has to name one host, and at most one site that it comes from"
        reason = self.door.refusal(request.path, hosts[0], next(iter(origins), None))
        if reason and reason not in self._refused and len(self._refused) < _MOST_SAID:
            self._refused.add(reason)
            log.warning("the page refused a request: %s", reason)
        return reason

    def refuse_message(self, data: str | bytes) -> str | None:
        """Why a message is dropped, or empty to drop it silently; None if it is allowed."""
        message = understand(data)
        if message is None:
            return ""
        if not isinstance(message, Update):
            return None
        there = {} if self.gui is None else self.gui._gui_input_handle_from_uuid
        element = there.get(message.uuid)
        if element is None:  # it was taken away meanwhile
            return ""
        reason = refusal(element, message.updates.value)
        if not reason:
            return None
        self._show_again(message.uuid, element)
        return f"{getattr(element, 'label', '')}: {reason}"

    def _show_again(self, uuid: str, element: Any) -> None:
        """Set the element in browsers back to its value, after one of them tried another."""
        if not isinstance(element, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
            assert self.gui is not None
            message = GuiUpdateMessage(uuid, {"value": element.value})
            self.gui._websock_interface.queue_message(message)

    async def ask(self, request: Request) -> Response | None:
        """The answer to an allowed request, where it is ours to answer."""
        path, _, query = request.path.partition("?")
        if path not in ("", "/") or not query or "Upgrade" in request.headers:
            return None
        found = await asyncio.to_thread(self._answers, query, request.headers)
        if found is None:
            return None
        headers = Headers(
            {"Content-Type": found.type, "Cache-Control": "no-store", **found.headers}
        )
        headers["Content-Length"] = str(len(found.body))
        status = HTTPStatus(found.status)
        return Response(status.value, status.phrase, headers, found.body)

    async def _takes(self, connection: _Connection) -> bool:
        """Whether a connection was ours and not viser's."""
        assert connection.request is not None
        query = connection.request.path.partition("?")[2]
        if not query or self._receive is None:
            return False
        return await self._receive(query, connection.receive)

    def _connect(self, *args: Any, **settings: Any) -> _Connection:
        return _Connection(self, *args, **settings)


class _Serve(websockets.asyncio.server.serve):
    """A server that forgets nobody as it ends."""

    async def __aexit__(self, *raised: Any) -> None:
        """Accept nobody more, and close it when it knows all whom it accepted.

        It learns of a connection some turns of the loop later. One that comes just before the end
        would stay open.
        """
        loop = asyncio.get_running_loop()
        for listening in self.server.sockets:
            loop.remove_reader(listening.fileno())
        for _ in range(_TURNS_TO_ACCEPT):
            await asyncio.sleep(0)
        await super().__aexit__(*raised)


class _Connection(ServerConnection):
    """One browser's connection."""

    def __init__(self, gate: Gate, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._gate = gate
        self._said = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Let little wait for a slow browser: what waits in the system's buffer gets old."""
        there = transport.get_extra_info("socket")
        there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BYTES)
        super().connection_made(transport)

    async def handshake(
        self,
        process_request: _Admit | None = None,
        process_response: Any = None,
        server_header: str | None = None,
    ) -> None:
        """Answer the request, if it may come in."""

        async def admit(connection: ServerConnection, request: Request) -> Any:
            reason = self._gate.refuse(request)
            if len(request.path.partition("?")[0]) > _LONGEST_PATH:
                return connection.respond(HTTPStatus.REQUEST_URI_TOO_LONG, "no such page\n")
            if reason:
                return connection.respond(HTTPStatus.FORBIDDEN, f"ros-visualise: {reason}\n")
            request.path = self._gate.door.inside(request.path)
            own = await self._gate.ask(request)
            if own is not None:
                return own
            answer = process_request(connection, request) if process_request else None
            is_foreign = self._gate.door.is_foreign(request.headers.get_all("Sec-Fetch-Site"))
            return answer and complete(answer, self._gate.title, is_foreign)

        await super().handshake(admit, self._answer, None)

    async def receive(self) -> str | bytes:
        """The next message, whatever it is."""
        return await super().recv()

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that passes."""
        while True:
            data = await super().recv(decode)
            reason = self._gate.refuse_message(data)
            if reason is None:
                return data
            if reason and self._said < _MOST_SAID:
                self._said += 1
                log.warning("the page: %s", reason)

    def _answer(self, _: ServerConnection, __: Request, response: Response) -> Response:
        """Add headers by which no other site can embed this one, or learn of it."""
        allowed = " ".join(["'self'", *sorted(self._gate.door.origins)])
        response.headers["Content-Security-Policy"] = f"frame-ancestors {allowed}"
        response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
        response.headers["Referrer-Policy"] = "no-referrer"
        response.headers["X-Content-Type-Options"] = "nosniff"
        return response
