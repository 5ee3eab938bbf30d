"""The writer's side of `lending`."""

from __future__ import annotations

import mmap
import os
import socket

import numpy as np

from ros_visualise.runtime.memory import Buffer
from ros_visualise.runtime.ros1 import lending, same_host
from ros_visualise.runtime.ros1.lending import FILLED, LOAN, NUMBER
from ros_visualise.runtime.ros1.wire import LENGTH, Parcel


class Borrower:
    """Writes large messages into memory of the reader of a connection, as soon as it lends some.

    Of its methods only `close` may be called while another one is at work.

    Args:
        connection: to the reader, who may be a stock node.
    """

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._listener: socket.socket | None = None
        self._lender: socket.socket | None = None
        self._blocks: dict[int, Buffer] = {}
        self._lent = 0  # no block has this number
        self._may_listen = True

    def is_ready(self, size: int, wait: bool = False) -> bool:
        """Whether a message of that size is taken now; ``wait``: wait until it is.

        One that is delivered all the same goes through the connection.
        """
        if not _is_large(size):
            return True
        if self._lender is None:
            self._meet()
        while self._lender is not None and not self._lent:
            try:
                self._hear(self._lender, wait)
            except BlockingIOError:
                return False
            except (OSError, ValueError):  # the reader lends nothing more
                self.close()
                self._lender = None
        return True

    def deliver(self, parcel: Parcel) -> list[memoryview]:
        """Bring a message on its way; gives what has to go through the connection."""
        block = self._blocks.get(self._lent)
        if block is None or not _is_large(parcel.size):
            return parcel.buffers
        number, self._lent = self._lent, 0
        return _fill(block, number, parcel)

    def close(self) -> None:
        """Borrow nothing more; ends a wait."""
        self._may_listen = False
        if self._listener is not None:
            self._listener.close()
        lender = self._lender
        if lender is not None:
            same_host.end(lender)
        self._blocks = {}

    def _meet(self) -> None:
        """Find the reader, if it has come."""
        if self._may_listen:
            self._may_listen = False
            self._listener = same_host.listen(self._connection)
        elif self._listener is not None:
            self._lender = same_host.accept(self._listener)
            if self._lender is not None:
                self._listener.close()
                self._listener = None

    def _hear(self, lender: socket.socket, wait: bool) -> None:
        record, descriptor = same_host.receive(lender, LOAN.size, wait)
        number, size = LOAN.unpack(record)
        if descriptor is not None:
            try:
                self._blocks[number] = np.frombuffer(mmap.mmap(descriptor, size), np.uint8)
            finally:
                os.close(descriptor)
        if size:
            self._lent = number
        else:
            self._blocks.pop(number, None)


def _is_large(size: int) -> bool:
    return lending.LARGE <= size < FILLED


def _fill(block: Buffer, number: int, parcel: Parcel) -> list[memoryview]:
    """Write a message, without its length, into a block; gives the note that tells of it."""
    size = parcel.size - 4
    if size > block.nbytes:
        return [_note(number, 0), *parcel.buffers]
    at = 0
    for buffer in (parcel.buffers[0][4:], *parcel.buffers[1:]):
        block[at : at + buffer.nbytes] = np.frombuffer(buffer, np.uint8)
        at += buffer.nbytes
    return [_note(number, size)]


def _note(number: int, size: int) -> memoryview:
    return memoryview(LENGTH.pack(FILLED + size) + NUMBER.pack(number))
