"""The way beside a connection, for two processes of one user on one host.

It is a Unix socket whose name says which TCP connection it belongs to, so that neither side has to
announce it: the writer listens there before it sends its first large message, and the reader comes
when it has got that one. At a stock node's end nobody listens or nobody comes. Such a name is known
in one network namespace alone and is no file: nothing is left of it, however a process ends.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections.abc import Callable
from typing import Any

Address = Callable[[], Any]

_DESCRIPTOR = struct.Struct("i")
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid


def listen(connection: socket.socket) -> socket.socket | None:
    """Await the reader of a connection; None where that cannot be."""
    name = _name(connection, connection.getsockname, connection.getpeername)
    if name is None:
        return None
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        listener.bind(name)
        listener.listen(1)
    except OSError:
        listener.close()
        return None
    listener.setblocking(False)
    return listener


def accept(listener: socket.socket) -> socket.socket | None:
    """The reader, once it has come; processes of other users are rejected."""
    try:
        return _of_same_user(listener.accept()[0])
    except OSError:
        return None


def connect(connection: socket.socket) -> socket.socket | None:
    """Come to the writer of a connection; None if it does not await anybody."""
    name = _name(connection, connection.getpeername, connection.getsockname)
    if name is None:
        return None
    beside = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    beside.setblocking(False)
    try:
        beside.connect(name)
        return _of_same_user(beside)
    except OSError:
        beside.close()
        return None


def send(beside: socket.socket, record: bytes, descriptor: int | None = None) -> None:
    """Send a record, and an open file with it; without waiting.

    Raises:
        OSError: nobody is there any more, or takes anything.
    """
    files = [] if descriptor is None else [_DESCRIPTOR.pack(descriptor)]  # send_fds() would wait
    beside.sendmsg(
        [record],
        [(socket.SOL_SOCKET, socket.SCM_RIGHTS, one) for one in files],
        socket.MSG_DONTWAIT,
    )


def receive(beside: socket.socket, size: int, wait: bool) -> tuple[bytes, int | None]:
    """The next record, of so many bytes, and the descriptor of the open file that came with it.

    Raises:
        BlockingIOError: none has come yet, and ``wait`` is false.
        OSError: there will be none.
    """
    flags = socket.MSG_CMSG_CLOEXEC | (0 if wait else socket.MSG_DONTWAIT)
    room = socket.CMSG_SPACE(_DESCRIPTOR.size)
    record, beside_it, *_ = beside.recvmsg(size, room, flags)
    if len(record) != size:
        raise ConnectionError("the other side closed the connection")
    return record, next((_DESCRIPTOR.unpack(data)[0] for *_, data in beside_it), None)


def end(beside: socket.socket) -> None:
    """Close it, and wake the threads that wait for it."""
    with contextlib.suppress(OSError):
        beside.shutdown(socket.SHUT_RDWR)
    beside.close()


def _name(connection: socket.socket, writer: Address, reader: Address) -> bytes | None:
    inet = connection.family in (socket.AF_INET, socket.AF_INET6)
    if not (inet and hasattr(os, "memfd_create")):  # else no Linux
        return None
    try:
        (host, port, *_), (reader_host, reader_port, *_) = writer(), reader()
    except OSError:  # it is closed
        return None
    return f"\0ros_visualise {host}:{port} {reader_host}:{reader_port}".encode()


def _of_same_user(beside: socket.socket) -> socket.socket | None:
    given = beside.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    if _CREDENTIALS.unpack(given)[1] != os.geteuid():
        beside.close()
        return None
    beside.setblocking(True)
    return beside
