"""The web server of the page: bound to one address, silent."""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import threading
from typing import Any

import rich
import viser
from viser.infra._async_message_buffer import AsyncMessageBuffer

from ros_visualise.errors import OpenError

_CLOSE_S = 0.8


class _LoopEvent(asyncio.Event):
    """An event that only the loop's own thread sets.

    viser sets one from whatever thread changes the page, and once more from the loop. Events are
    not made for the first: now and then it fails, as the loop's waiters change meanwhile.
    """

    def set(self) -> None:
        if asyncio._get_running_loop() is not None:
            super().set()


class _Messages(AsyncMessageBuffer):  # type: ignore[misc]
    """viser's messages to a browser, to which any thread can add."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, message_event=_LoopEvent(), **kwargs)


def open_server(host: str, port: int, title: str) -> viser.ViserServer:
    """Bind a server to this address and to no other.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """
    _check_address(host, port)
    _silence()
    server = viser.ViserServer(host, port, label=title, verbose=False)
    if server.get_port() != port:  # somebody took it since; viser went on to the next
        close_server(server)
        raise OpenError(_in_use(host, port))
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    return server


def close_server(server: viser.ViserServer) -> None:
    """End it; a browser that does not answer is not waited for."""
    stopping = threading.Thread(target=server.stop, daemon=True)
    stopping.start()
    stopping.join(_CLOSE_S)


def url(host: str, port: int) -> str:
    """What to type into a browser on this machine."""
    name = {"0.0.0.0": "127.0.0.1", "": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"http://[{name}]:{port}" if ":" in name else f"http://{name}:{port}"


def _check_address(host: str, port: int) -> None:
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        for family, _, _, _, address in addresses:
            socket.create_server(address[:2], family=family).close()
    except OSError as error:
        raise OpenError(_what_is_wrong(error, host, port)) from None


def _what_is_wrong(error: OSError, host: str, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return _in_use(host, port)
    if error.errno == errno.EACCES:
        return f"port {port} needs the rights of an administrator; choose another with --port 8080"
    return f"--host {host}: not an address of this machine; take 127.0.0.1, or 0.0.0.0 for all"


def _in_use(host: str, port: int) -> str:
    other = port + 1 if port < 65535 else 8080
    return f"port {port} on {host} is in use; choose another with --port {other}"


def _silence() -> None:
    """Standard output is for reports, and a dropped connection or a port probe is no news."""
    rich.reconfigure(quiet=True)
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
