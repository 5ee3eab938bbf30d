"""viser without a server of its own: its page and its WebSockets are parts of ours.

viser 1.1 accepts every kind of message, and makes its server where it cannot be configured. So it
is given a server that opens no port, and that checks all messages before they are handled.
"""

from __future__ import annotations

import asyncio
import gzip
import logging
from collections.abc import Callable
from itertools import count
from threading import Lock
from typing import Any

import rich
import viser
import viser.infra
from viser._messages import GuiUpdateMessage
from viser.infra import ClientId, Message, WebsockClientConnection, WebsockServer
from viser.infra._async_message_buffer import AsyncMessageBuffer
from viser.infra._infra import _ClientHandleState, _message_consumer, _message_producer

from ros_visualise.ui.page.inbound import CameraMessage, UpdateMessage, refusal, understand
from ros_visualise.ui.page.scripts import client_page
from ros_visualise.ui.server.answers import READ_ONLY, Answer, Refusal
from ros_visualise.ui.server.gate import (
    MOST_REPORTED,
    App,
    Disconnected,
    Receive,
    Scope,
    Send,
    Visit,
    send_answer,
)
from ros_visualise.ui.shell import FOREIGN, VISER

log = logging.getLogger(__name__)

_FEW = 64
_one_at_a_time = Lock()


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets.

    When a thread changes a page, viser 1.1 sets an `asyncio.Event` from that thread, and again from
    its loop. Events are not thread-safe: now and then the first call raises a RuntimeError. The
    second call is enough.
    """

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _Outbox(AsyncMessageBuffer):
    """Drops what all browsers have received as soon as a third of its messages may be removals.

    viser 1.1 keeps a message for each removed element until the next browser connects, and warns
    of one for a browser that has left, as happens between threads.
    """

    tidy: Callable[[], None] | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.message_event = _LoopEvent()
        self._removals = 0

    def push(self, message: Message) -> None:
        if self.done:  # its browser has just left
            return
        super().push(message)
        if self.tidy is None or message.lifecycle_phase != "remove":
            return
        self._removals += 1
        if self._removals > max(_FEW, len(self.message_from_id) // 3):
            self._removals = 0
            self.tidy()


class Embedded(WebsockServer):
    """A server for viser: an ASGI application for its page and its WebSockets.

    Attributes:
        gui: the elements that browsers may change; None until there are any.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        self.gui: viser.GuiApi | None = None
        self._background_event_loop = loop
        self._broadcast_buffer = _Outbox(loop, persistent_messages=True)
        self._numbers = count()
        self._reported: set[str] = set()

    def start(self) -> None:
        """Nothing to do: it is called when a browser comes."""

    def stop(self) -> None:
        self._broadcast_buffer.set_done()
        for client in list(self._client_state_from_id.values()):
            client.message_buffer.set_done()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        visit: Visit = scope["state"]["visit"]
        if scope["type"] == "http":
            await send_answer(scope, send, _page(scope, visit))
            return
        version = f"viser-v{viser.__version__}"
        await receive()  # the request to connect
        chosen = next((one for one in scope["subprotocols"] if one == version), None)
        await send({"type": "websocket.accept", "subprotocol": chosen})
        if chosen is None:
            await send({"type": "websocket.close", "code": 1002, "reason": f"only {version}"})
            return
        await self._serve(_Connection(self, receive, send, visit.is_viewer))

    def refuse(self, data: str | bytes, is_viewer: bool) -> str | None:
        """The reason to drop a message, or empty to drop it silently; None if it is allowed."""
        message = understand(data)
        if message is None:
            return ""
        if is_viewer and not isinstance(message, CameraMessage):
            return f"change by a viewer rejected: {READ_ONLY}"
        if not isinstance(message, UpdateMessage):
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
        """Restore an element in browsers, after one of them tried another value."""
        if not isinstance(element, viser.GuiButtonHandle | viser.GuiButtonGroupHandle):
            self.queue_message(GuiUpdateMessage(uuid, {"value": element.value}))

    async def _serve(self, connection: _Connection) -> None:
        """Send a browser what is there and what changes, and handle what it sends, to its end."""
        loop = asyncio.get_running_loop()
        number = ClientId(next(self._numbers))
        state = _ClientHandleState(_Outbox(loop, persistent_messages=False), loop)
        client = WebsockClientConnection(number, state)
        self._client_state_from_id[number] = state
        self._live_connections[number] = connection  # type: ignore[assignment]

        handling: set[asyncio.Task[None]] = set()

        def handle(message: Message) -> None:
            for handler in (self, client):
                task = loop.create_task(handler._handle_incoming_message(number, message))
                handling.add(task)
                task.add_done_callback(handling.discard)

        for connected in self._client_connect_cb:
            await _call(connected, client)
        tasks = [
            asyncio.ensure_future(_message_producer(connection, state.message_buffer, number)),  # type: ignore[arg-type]
            asyncio.ensure_future(
                _message_producer(
                    connection,  # type: ignore[arg-type]
                    self._broadcast_buffer,
                    number,
                    backlog_done_message=self._backlog_done_message,
                )
            ),
            asyncio.ensure_future(_message_consumer(connection, handle, self._message_class)),  # type: ignore[arg-type]
        ]
        try:
            await asyncio.gather(*tasks)
        except Disconnected:
            pass
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            state.message_buffer.set_done()
            self._client_state_from_id.pop(number, None)
            self._live_connections.pop(number, None)
            self._broadcast_buffer.generator_cursors.pop(number, None)
            for left in self._client_disconnect_cb:
                await _call(left, client)


class _Connection:
    """One browser's WebSocket, as viser uses it; gives only messages that are allowed."""

    def __init__(self, server: Embedded, receive: Receive, send: Send, is_viewer: bool) -> None:
        self.is_viewer = is_viewer
        self._server, self._receive, self._send = server, receive, send
        self._reported: set[str] = set()

    async def recv(self) -> str | bytes:
        while True:
            message = await self._receive()
            if message["type"] == "websocket.disconnect":
                raise Disconnected
            data = message.get("bytes") or message.get("text") or b""
            reason = self._server.refuse(data, self.is_viewer)
            if reason is None:
                return data
            if reason and len(self._reported) < MOST_REPORTED and reason not in self._reported:
                self._reported.add(reason)
                log.warning("page: %s", reason)

    async def send(self, data: bytes) -> None:
        try:
            await self._send({"type": "websocket.send", "bytes": data})
        except OSError:  # it has gone
            raise Disconnected from None


def embed(loop: asyncio.AbstractEventLoop, title: str) -> tuple[viser.ViserServer, App]:
    """viser on an event loop, and the application that serves it."""
    rich.reconfigure(quiet=True)  # standard output is for reports

    made: list[Embedded] = []

    def make(*args: Any, **settings: Any) -> Embedded:
        made.append(Embedded(loop, *args, **settings))
        return made[0]

    with _one_at_a_time:
        own = viser.infra.WebsockServer
        viser.infra.WebsockServer = make  # type: ignore[assignment,misc]
        try:
            server = viser.ViserServer("", 0, label=title, verbose=False)
        finally:
            viser.infra.WebsockServer = own  # type: ignore[misc]
    (embedded,) = made
    embedded.gui = server.gui
    outbox = embedded._broadcast_buffer
    assert isinstance(outbox, _Outbox)
    outbox.tidy = server._run_garbage_collector
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    return server, embedded


async def _call(callback: Callable[[Any], Any], client: WebsockClientConnection) -> None:
    done = callback(client)
    if asyncio.iscoroutine(done):
        await done


def _page(scope: Scope, visit: Visit) -> Answer:
    """viser's page, which is one file."""
    if scope["path"] != scope["root_path"] + VISER:
        raise Refusal("no such page", 404)
    is_foreign = visit.is_foreign or FOREIGN.encode() in scope["query_string"]
    packed = client_page(is_foreign, visit.is_viewer)
    takes_gzip = any(
        key == b"accept-encoding" and b"gzip" in value for key, value in scope["headers"]
    )
    if takes_gzip:
        return Answer(packed, "text/html; charset=utf-8", headers={"Content-Encoding": "gzip"})
    return Answer(gzip.decompress(packed), "text/html; charset=utf-8")
