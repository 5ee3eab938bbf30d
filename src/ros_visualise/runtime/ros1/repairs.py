"""Faults of rospy that would keep peers from a process or fill it with open files, repaired.

rospy reads the first words of each peer on the one thread that accepts connections, without a limit
of time or size, and for good without that thread when it cannot open another file: one peer that
says nothing, or never ends, keeps all others away.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Callable
from functools import partial
from io import BytesIO
from socket import socket
from typing import Any

from rosgraph.network import ROSHandshakeException, decode_ros_handshake_header
from rospy import topics
from rospy.impl import tcpros_base

from ros_visualise.core import supervision

_LENGTH = struct.Struct("<I")
_LONGEST = 2**24
"""Bytes of a header, which holds the definition of a message."""
_PATIENCE_S = 10.0
_AGAIN_S = 1.0

Handle = Callable[[socket, Any], None]


class _Server(tcpros_base.TCPServer):  # type: ignore[misc]
    """Accepts connections for as long as the process runs."""

    def __init__(self, handle: Handle, port: int = 0) -> None:
        super().__init__(partial(_begin, handle), port)

    def start(self) -> None:
        supervision.start("connections", self.run, _AGAIN_S)


def _begin(handle: Handle, connection: socket, address: Any) -> None:
    connection.settimeout(_PATIENCE_S)
    supervision.start(f"connection from {address[0]}", partial(handle, connection, address))


def read_header(connection: socket, left: BytesIO, _: int) -> Any:
    """The header that a peer begins with, in rospy's place.

    Args:
        connection: to the peer; all of the header has to come within its timeout, which it loses.
        left: takes what was read beyond the header: nothing.

    Raises:
        ROSHandshakeException: it is none, too long, or does not come in time.
    """
    patience_s = connection.gettimeout()
    end_s = math.inf if patience_s is None else time.monotonic() + patience_s
    try:
        length = _read(connection, _LENGTH.size, end_s)
        (size,) = _LENGTH.unpack(length)
        if size > _LONGEST:
            raise ROSHandshakeException(f"the peer announces a header of {size} bytes")
        return decode_ros_handshake_header(length + _read(connection, size, end_s))
    finally:
        connection.settimeout(None)


def _read(connection: socket, size: int, end_s: float) -> bytes:
    found = bytearray()
    while len(found) < size:
        left_s = end_s - time.monotonic()
        connection.settimeout(None if math.isinf(left_s) else max(left_s, 0.001))
        try:
            piece = connection.recv(size - len(found))
        except TimeoutError:
            raise ROSHandshakeException("timed out waiting for the header") from None
        if not piece:
            raise ROSHandshakeException("the peer closed the connection before sending its header")
        found += piece
    return bytes(found)


def mend_handshakes() -> None:
    """Let no peer keep others from connecting to this process, from its first topic on."""
    tcpros_base.TCPServer = _Server
    tcpros_base.read_ros_handshake_header = read_header


class _Poller(topics.Poller):  # type: ignore[misc]
    """Does not refer to itself: it goes with the topic that has it."""

    def __init__(self) -> None:
        super().__init__()
        for name in ("add_fd", "remove_fd", "error_iter"):
            delattr(self, name)

    add_fd = topics.Poller.add_epoll
    remove_fd = topics.Poller.remove_epoll
    error_iter = topics.Poller.error_epoll_iter


def mend_pollers() -> None:
    """Let the topics of this process that are left from now on leave no open file behind.

    A poller of rospy holds its own methods, so that only Python's collector ends it. In a process
    that has much else, as the page has, this comes hours later.
    """
    topics.Poller = _Poller
