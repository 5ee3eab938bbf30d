"""The web server of the page: bound to one address, guarded, silent."""

from __future__ import annotations

import errno
import logging
import socket

import rich
import viser

from ros_visualise.core import supervision
from ros_visualise.core.errors import OpenError
from ros_visualise.ui.page.connection import guarded_by
from ros_visualise.ui.page.door import Door
from ros_visualise.ui.page.gate import Answers, Gate, Receiver
from ros_visualise.ui.page.outbox import keep_tidy, mend_outboxes

_CLOSE_S = 0.8


async def _nothing(*_: object) -> None:
    return None


def open_server(
    host: str,
    port: int,
    title: str,
    door: Door,
    flag: str = "--{} {}",
    answer: Answers = _nothing,
    receive: Receiver | None = None,
) -> viser.ViserServer:
    """Bind a server to this address and no other; it checks every request.

    Args:
        title: what the browser's tab is called.
        flag: how a person gives another port: its name and its value go in.
        answer: gives the answers that are not viser's.
        receive: takes the connections that are not viser's.

    Raises:
        OpenError: the port is in use, or the address is not one of this machine.
    """
    _check_address(host, port, flag)
    _silence()
    mend_outboxes()
    gate = Gate(door, title, answer, receive)
    with guarded_by(gate):
        server = viser.ViserServer(host, port, label=title, verbose=False)
    keep_tidy(server)
    gate.gui = server.gui
    if not gate.is_used:
        close_server(server)
        raise RuntimeError("this viser makes its server in another way: nobody would guard it")
    if server.get_port() != port:  # somebody took it since; viser went on to the next
        close_server(server)
        raise OpenError(_in_use(host, port, flag))
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
    return server


def empty_server(server: viser.ViserServer) -> None:
    """Take all from the page; browsers stay connected."""
    server.scene.remove_click_callback()
    server.scene.reset()
    server.gui.reset()


def close_server(server: viser.ViserServer) -> None:
    """End it, without waiting for browsers that do not answer."""
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
        return f"port {port} needs the rights of an administrator; choose another with {other}"
    given = flag.format("host", host)
    return f"{given}: not an address of this machine; take 127.0.0.1, or 0.0.0.0 for all"


def _in_use(host: str, port: int, flag: str) -> str:
    other = flag.format("port", port + 1 if port < 65535 else 8080)
    return f"port {port} on {host} is in use; choose another with {other}"


def _silence() -> None:
    """Print nothing: standard output is for reports, and dropped connections are normal."""
    rich.reconfigure(quiet=True)
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
