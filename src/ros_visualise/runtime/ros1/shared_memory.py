"""Large messages between processes of one host, in memory that the reader lends to the writer.

Through a TCP connection an image is copied twice, and by the kernel. So it is written once, to
where it is read: the reader lends a block when it has time for a message, and the writer sends a
note of a few bytes in the message's place when it has filled it. All blocks are the reader's own:
it uses one anew when nobody holds what was received in it. They are no files: nothing is left of
them when either side is killed.
"""

from __future__ import annotations

import fcntl
import itertools
import mmap
import os
import socket
import struct

import numpy as np

from ros_visualise.runtime.memory import MOST_HELD, SPARE, Buffer, is_held
from ros_visualise.runtime.ros1 import same_host
from ros_visualise.runtime.ros1.wire import LENGTH, Parcel

LARGE = 4 * 2**20
"""Messages of fewer bytes go through the connection: its sockets have room for several of them."""

LOAN = struct.Struct("<QQ")
"""From the reader: a block's number, and its bytes; none if it is there no longer."""

FILLED = 2**31
"""Note to the reader in a message's place: this + its bytes, and the number of its block.

Without bytes: the block is given back, since it is too small for the message that follows.
"""

NUMBER = struct.Struct("<Q")

_ROOM = 1.5  # of a block, as a multiple of the message that it is made for
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL


class Lender:
    """The reader's side.

    Args:
        beside: to the writer, see `same_host`.
    """

    def __init__(self, beside: socket.socket) -> None:
        self._socket = beside
        self._blocks: dict[int, Buffer] = {}
        self._numbers = itertools.count(1)
        self._lent = 0  # no block has this number

    def lend(self, size: int) -> None:
        """Lend a block for a message of that size, if none is lent.

        Without memory, or without a writer, that was the last one: the writer notices it.
        """
        if self._lent or self._socket.fileno() < 0:
            return
        try:
            self._lent = self._unheld(size)
            if self._lent:
                self._tell(self._lent, self._blocks[self._lent].nbytes)
            else:
                self._lent = self._add(size)
        except OSError:
            self.close()

    def take(self, number: int, size: int) -> Buffer:
        """The message that was written into a block, which is lent no longer.

        Raises:
            KeyError: no such block.
        """
        if number != self._lent or size > self._blocks[number].nbytes:
            raise KeyError(number)
        self._lent = 0
        return self._blocks[number][:size]

    def close(self) -> None:
        """Lend nothing more."""
        self._socket.close()

    def _unheld(self, size: int) -> int:
        """A block that nobody holds; the others that nobody holds go, but for a few."""
        unheld = [number for number in self._blocks if not is_held(self._blocks, number)]
        held = [number for number in self._blocks if number not in unheld]
        fitting = [n for n in unheld if size <= self._blocks[n].nbytes <= 2 * size][:SPARE]
        for number in {*unheld, *held[:-MOST_HELD]} - {*fitting}:
            del self._blocks[number]
            self._tell(number, 0)
        return fitting[0] if fitting else 0

    def _add(self, size: int) -> int:
        number = next(self._numbers)
        length = int(size * _ROOM)  # what is never written to takes no memory
        descriptor = os.memfd_create("ros_visualise", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.ftruncate(descriptor, length)
            fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, _SEALS)
            self._blocks[number] = np.frombuffer(mmap.mmap(descriptor, length), np.uint8)
            self._tell(number, length, descriptor)
        finally:
            os.close(descriptor)
        return number

    def _tell(self, number: int, size: int, descriptor: int | None = None) -> None:
        same_host.send(self._socket, LOAN.pack(number, size), descriptor)


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
        """True if a message of that size is taken now; ``wait``: wait until it is.

        One that is delivered in any case goes through the connection.
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
    return LARGE <= size < FILLED


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
