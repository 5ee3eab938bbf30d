"""Receiving from a publisher in rospy's place, into the buffer that the message then holds."""

from __future__ import annotations

import logging
import socket
import struct
from collections.abc import Callable
from typing import Any

import genpy
from rospy.exceptions import TransportTerminated

from ros_visualise.runtime.memory import Buffer, BufferPool
from ros_visualise.runtime.ros1 import same_host, shared_memory
from ros_visualise.runtime.ros1.shared_memory import FILLED, NUMBER, Lender
from ros_visualise.runtime.ros1.wire import LENGTH, decode

_LARGEST = 2**30  # bytes; a longer message is a broken stream


class BrokenStream(Exception):
    """The bytes received are no message."""


class Stream:
    """The messages that come from one publisher.

    Args:
        sock: blocking.
        early: what was read of them already, together with the publisher's handshake.
    """

    def __init__(self, sock: socket.socket, early: bytes = b"") -> None:
        self._socket = sock
        self._early = memoryview(early)
        self._pool = BufferPool()
        self._lender: Lender | None = None
        self._met = False
        self._large = 0  # bytes of the last large message

    def receive(self) -> Buffer:
        """The next message's bytes, without its length.

        Raises:
            EOFError: the connection was closed.
            BrokenStream: it announces what cannot be.
        """
        if self._large:
            self._lend()
        size = self._read(LENGTH)
        while self._lender is not None and size >= FILLED:
            body = self._lent(self._lender, size - FILLED)
            if body.nbytes:
                self._large = body.nbytes
                return body
            size = self._read(LENGTH)  # of the message for which the block was too small
        if size > _LARGEST:
            raise BrokenStream(f"the publisher announces a message of {size} bytes")
        self._large = size if size >= shared_memory.LARGE else self._large
        try:
            body = self._pool.take(size)
        except MemoryError:
            raise BrokenStream(f"no memory for a message of {size} bytes") from None
        self._fill(body.data)
        return body

    def close(self) -> None:
        """Lend no memory any more."""
        self._met = True
        if self._lender is not None:
            self._lender.close()

    def _lend(self) -> None:
        """Lend the writer memory for the next message, if it is on this host."""
        if not self._met:
            self._met = True
            beside = same_host.connect(self._socket)
            self._lender = None if beside is None else Lender(beside)
        if self._lender is not None:
            self._lender.lend(self._large)

    def _lent(self, lender: Lender, size: int) -> Buffer:
        """A message that was written into lent memory."""
        number = self._read(NUMBER)
        try:
            return lender.take(number, size)
        except KeyError:
            raise BrokenStream(f"the publisher refers to unknown shared memory {number}") from None

    def _read(self, format: struct.Struct) -> int:
        buffer = bytearray(format.size)
        self._fill(memoryview(buffer))
        (number,) = format.unpack(buffer)
        return int(number)

    def _fill(self, view: memoryview) -> None:
        count = min(view.nbytes, self._early.nbytes)
        view[:count] = self._early[:count]
        self._early = self._early[count:]
        while count < view.nbytes:
            view = view[count:]
            count = self._socket.recv_into(view, 0, socket.MSG_WAITALL)
            if not count:
                raise EOFError


log = logging.getLogger(__name__)


class Receiver:
    """Takes the place of ``receive_once`` of a TCPROSTransport.

    Args:
        connection: not yet open.
        message_class: of genpy.
        refuse: called with the reason why bytes are no message.
    """

    def __init__(self, connection: Any, message_class: Any, refuse: Callable[[str], None]) -> None:
        self._connection = connection
        self._class = message_class
        self._refuse = refuse
        self._stream: Stream | None = None

    def __call__(self) -> list[Any]:
        """The next message; none where what came was not one.

        Raises:
            TransportTerminated: there will be no more.
        """
        connection = self._connection
        if self._stream is None:  # what rospy has read together with the handshake comes first
            self._stream = Stream(connection.socket, connection.read_buff.getvalue())
        try:
            body = self._stream.receive()
            message = decode(body, self._class)
        except genpy.DeserializationError as error:
            self._refuse(f"not a message: {error}")
            return []
        except BrokenStream as error:
            log.warning(
                "%s: %s; closing connection to %s", connection.name, error, connection.endpoint_id
            )
            raise TransportTerminated(str(error)) from error
        except (EOFError, OSError) as error:
            raise TransportTerminated("the publisher closed the connection") from error
        message._connection_header = connection.header
        connection.stat_bytes += body.nbytes + 4
        connection.stat_num_msg += 1
        if connection.is_latched:
            connection.latch = message
        return [message]

    def close(self) -> None:
        """Release the memory of the connection."""
        if self._stream is not None:
            self._stream.close()
