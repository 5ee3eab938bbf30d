"""Connections to the page: few that are silent, none that accepts no data for long."""

from __future__ import annotations

import asyncio
import errno
import socket
from asyncio import TimerHandle
from collections.abc import Callable
from functools import partial
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from ros_visualise.core.errors import OpenError

SEND_BYTES = 128 << 10  # 20 Mbit/s where the way there and back takes 50 ms
REQUEST_S = 10.0
"""Time limit for a connection to send its request."""
STALL_S = 30.0
"""A browser that accepts no data for so long is disconnected."""
_GOODBYE_S = 0.5
_MOST_SILENT = 100
"""Maximum number of connections without a request; one more ends the oldest."""


def listen(host: str, port: int, flag: str) -> list[socket.socket]:
    """Sockets that listen at an address; what waits in them for a slow browser is little.

    Args:
        flag: the form of a command-line option, for hints, with a name and a value to fill in.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """
    listening: list[socket.socket] = []
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        for family, _, _, _, address in dict.fromkeys(addresses):
            listening.append(socket.create_server(address[:2], family=family))
            listening[-1].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
    except (OSError, UnicodeError) as error:
        for one in listening:
            one.close()
        number = getattr(error, "errno", None)
        raise OpenError(_what_is_wrong(number, host, port, flag)) from None
    return listening


def _what_is_wrong(number: int | None, host: str, port: int, flag: str) -> str:
    if number == errno.EADDRINUSE:
        other = flag.format("port", port + 1 if port < 65535 else 8080)
        return f"port {port} on {host} is already in use; choose another with {other}"
    if number == errno.EACCES:
        other = flag.format("port", 8080)
        return f"port {port} needs administrator rights; choose another with {other}"
    given = flag.format("host", host)
    return f"{given}: not an address of this machine; use 127.0.0.1, or 0.0.0.0 for all"


class _Patient(asyncio.Protocol):
    """A connection that is aborted if its peer accepts no data for too long.

    ``report`` is called with a line for the log.
    """

    transport: asyncio.Transport
    _stalled: TimerHandle | None = None

    def __init__(self, *args: Any, report: Callable[[str], None], **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._report = report

    def connection_lost(self, exc: Exception | None) -> None:
        self._go_on()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        super().pause_writing()
        loop = asyncio.get_running_loop()
        self._stalled = loop.call_later(STALL_S, self._give_up, STALL_S)

    def resume_writing(self) -> None:
        super().resume_writing()
        self._go_on()

    def _go_on(self) -> None:
        if self._stalled is not None:
            self._stalled.cancel()

    def _give_up(self, stall_s: float) -> None:
        self._report(f"page: a browser accepted no data for {stall_s:g} s; connection closed")
        self.transport.abort()


class Door(_Patient, H11Protocol):
    """A connection for requests.

    Args:
        silent: all connections without a request yet, the oldest first.
        report: called with a line for the log.
    """

    def __init__(
        self, *args: Any, silent: dict[Door, None], report: Callable[[str], None], **settings: Any
    ) -> None:
        super().__init__(*args, report=report, **settings)
        self._silent = silent
        self.ws_protocol_class = partial(_SocketDoor, report=report)  # type: ignore[assignment]

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        transport.set_write_buffer_limits(0)  # so that all that waits is noticed
        self._silent[self] = None
        self._waiting = self.loop.call_later(REQUEST_S, transport.abort)
        if len(self._silent) > _MOST_SILENT:
            oldest = next(iter(self._silent))
            del self._silent[oldest]  # at once: many may come before it is lost
            oldest.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._enter()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if self.scope is not None:  # there was a request
            self._enter()

    def _enter(self) -> None:
        self._silent.pop(self, None)
        self._waiting.cancel()


class _SocketDoor(_Patient, WebSocketsSansIOProtocol):
    """A WebSocket."""

    _leaving: TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        if self._leaving is not None:
            self._leaving.cancel()
        super().connection_lost(exc)

    def handle_parser_exception(self) -> None:
        """End a browser that sends what is no message, or too much, even if it does not read."""
        super().handle_parser_exception()
        self._leaving = self.loop.call_later(_GOODBYE_S, self.transport.abort)

    def keepalive_timeout(self) -> None:
        """End a browser that does not answer, whatever still waits for it."""
        super().keepalive_timeout()
        self.transport.abort()
