"""The web server of the page: bound to one address, guarded, silent."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
from collections.abc import Callable
from typing import Any

import rich
import viser
from viser.infra import Message, _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError
from ros_visualise.ui.page.access import AccessRules
from ros_visualise.ui.page.connection import guarded_by
from ros_visualise.ui.page.gate import Answers, Gate, Receiver

_CLOSE_S = 0.8


async def _nothing(*_: object) -> None:
    return None


def open_server(
    host: str,
    port: int,
    title: str,
    rules: AccessRules,
    flag: str = "--{} {}",
    answer: Answers = _nothing,
    receive: Receiver | None = None,
) -> viser.ViserServer:
    """Bind a server to one address; it checks every request.

    Args:
        title: of the browser's tab.
        flag: the form of a command-line option, for hints, with a name and a value to fill in.
        answer: answers the requests that are not viser's.
        receive: takes the connections that are not viser's.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """
    _check_address(host, port, flag)
    _silence()
    make_thread_safe()
    gate = Gate(rules, title, answer, receive)
    with guarded_by(gate):
        server = viser.ViserServer(host, port, label=title, verbose=False)
    keep_tidy(server)
    gate.gui = server.gui
    if not gate.is_used:
        close_server(server)
        raise RuntimeError("unsupported viser: its server would be unguarded")
    if server.get_port() != port:  # taken meanwhile; viser went on to the next
        close_server(server)
        raise OpenError(_in_use(host, port, flag))
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    return server


def empty_server(server: viser.ViserServer) -> None:
    """Remove everything from the page; browsers stay connected."""
    server.scene.remove_click_callback()
    server.scene.reset()
    server.gui.reset()


def close_server(server: viser.ViserServer) -> None:
    """Stop the server without waiting for browsers."""
    supervision.start("server's end", server.stop).join(_CLOSE_S)


def url(host: str, port: int, token: str = "") -> str:
    """The address for a browser on this machine."""
    name = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "::1"}.get(host, host)
    name = f"[{name}]" if ":" in name else name
    return f"http://{name}:{port}" + (f"/{token}" if token else "")


def _check_address(host: str, port: int, flag: str) -> None:
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        for family, _, _, _, address in addresses:
            socket.create_server(address[:2], family=family).close()
    except (OSError, UnicodeError) as error:
        number = getattr(error, "errno", None)
        raise OpenError(_what_is_wrong(number, host, port, flag)) from None


def _what_is_wrong(number: int | None, host: str, port: int, flag: str) -> str:
    if number == errno.EADDRINUSE:
        return _in_use(host, port, flag)
    if number == errno.EACCES:
        other = flag.format("port", 8080)
        return f"port {port} needs administrator rights; choose another with {other}"
    given = flag.format("host", host)
    return f"{given}: not an address of this machine; use 127.0.0.1, or 0.0.0.0 for all"


def _in_use(host: str, port: int, flag: str) -> str:
    other = flag.format("port", port + 1 if port < 65535 else 8080)
    return f"port {port} on {host} is already in use; choose another with {other}"


def _silence() -> None:
    """Print nothing: standard output is for reports, and lost connections are normal."""
    rich.reconfigure(quiet=True)
    logging.getLogger("websockets").setLevel(logging.CRITICAL)


_FEW = 64


class _LoopEvent(asyncio.Event):
    """An event that only a running loop sets."""

    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _Outbox(AsyncMessageBuffer):
    """Tidies up as soon as a third of its messages may be removals."""

    tidy: Callable[[], None] | None = None

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.message_event = _LoopEvent()
        self._removals = 0

    def push(self, message: Message) -> None:
        super().push(message)
        if self.tidy is None or message.lifecycle_phase != "remove":
            return
        self._removals += 1
        if self._removals > max(_FEW, len(self.message_from_id) // 3):
            self._removals = 0
            self.tidy()


def make_thread_safe() -> None:
    """Let any thread change the pages that are opened from now on.

    When a thread changes a page, viser 1.1 sets an `asyncio.Event` from that thread, and again from
    its loop. Events are not thread-safe: now and then the first call raises a RuntimeError. The
    second call is enough.
    """
    _infra.AsyncMessageBuffer = _Outbox  # type: ignore[attr-defined]


def keep_tidy(server: viser.ViserServer) -> None:
    """Bound the memory of a page whose elements come and go.

    viser 1.1 keeps a message for each removed element until the next browser connects. Messages
    that all browsers have received are dropped here after every few removals.
    """
    outbox = server._websock_server._broadcast_buffer
    assert isinstance(outbox, _Outbox)
    outbox.tidy = server._run_garbage_collector
