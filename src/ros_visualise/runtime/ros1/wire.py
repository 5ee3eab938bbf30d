"""ROS 1's wire format for messages whose data is large: written and read without a copy.

On the wire a message is its length, four bytes, and its fields in order. The large field, ``data``,
is left where it is: what stands before and after it is serialized by the message's own class.
"""

from __future__ import annotations

import copy
import socket
import struct
import sys
from io import BytesIO
from typing import Any, NamedTuple

import genpy
import numpy as np
import numpy.typing as npt

_AFTER_DATA = {
    "sensor_msgs/Image": 0,
    "sensor_msgs/CompressedImage": 0,
    "sensor_msgs/PointCloud2": 1,
}
"""The types with a large field ``data`` -> how many bytes follow it."""

_LENGTH = struct.Struct("<I")
_LARGEST = 2**30  # bytes; a longer message is a broken stream
_SPARE = 3  # buffers that wait to be used anew
_MOST_HELD = 32  # buffers that come back when those who hold them let go

Buffer = npt.NDArray[np.uint8]


class Parcel(NamedTuple):
    """A message as it goes out: the buffers that make it up, and their length."""

    buffers: list[memoryview]
    size: int


class BrokenStream(Exception):
    """What comes is not a message."""


def is_large(message_class: Any) -> bool:
    """Whether messages of that class have a large field ``data``."""
    return message_class._type in _AFTER_DATA and "data" in message_class.__slots__


def as_bytes(data: Any) -> memoryview:
    """The bytes of a buffer of any shape and type, or of a list of numbers as rospy takes it.

    Raises:
        genpy.SerializationError: it is not contiguous, or no buffer.
    """
    try:
        listed = isinstance(data, (list, tuple))
        return np.frombuffer(bytes(data) if listed else data, np.uint8).data
    except (TypeError, ValueError) as error:
        raise genpy.SerializationError(f"data is not a buffer of bytes: {error}") from error


def encode(message: Any, seq: int) -> Parcel:
    """A message for the wire; its data must not change until it is sent.

    Args:
        message: of any class; the data of a large one may be any buffer of bytes.
        seq: for its header, if it has one.

    Raises:
        genpy.SerializationError: a field holds what it cannot.
    """
    if message._has_header:
        message.header.seq = seq
    if not is_large(message):
        body = _serialize(message)
        return Parcel([memoryview(_LENGTH.pack(len(body)) + body)], len(body) + 4)
    data = as_bytes(message.data)
    empty = copy.copy(message)
    empty.data = b""
    body = _serialize(empty)
    cut = len(body) - _AFTER_DATA[message._type]
    size = len(body) + data.nbytes
    head = _LENGTH.pack(size) + body[: cut - 4] + _LENGTH.pack(data.nbytes)
    buffers = [memoryview(head), data, memoryview(body[cut:])]
    return Parcel([one for one in buffers if one.nbytes], size + 4)


def decode(body: Buffer, message_class: Any) -> Any:
    """The message in a buffer; the data of a large one is a part of it, not a copy.

    Raises:
        genpy.DeserializationError: it is not of that class.
    """
    message = message_class()
    if not is_large(message_class):
        return message.deserialize(body.tobytes())
    message.deserialize(body.view(_Sliceable))
    message.data = message.data.view(np.ndarray)
    after_length = body.nbytes - _AFTER_DATA[message._type] - message.data.nbytes
    (announced,) = _LENGTH.unpack_from(body.data, after_length - 4)
    if announced != message.data.nbytes:
        raise genpy.DeserializationError(f"{announced} bytes of data are announced")
    return message


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

    def receive(self) -> Buffer:
        """The next message's bytes, without its length.

        Raises:
            EOFError: the connection was closed.
            BrokenStream: it announces what cannot be.
        """
        length = bytearray(4)
        self._fill(memoryview(length))
        (size,) = _LENGTH.unpack(length)
        if size > _LARGEST:
            raise BrokenStream(f"a message of {size} bytes is announced")
        try:
            body = self._pool.take(size)
        except MemoryError:
            raise BrokenStream(f"no memory for a message of {size} bytes") from None
        self._fill(body.data)
        return body

    def _fill(self, view: memoryview) -> None:
        count = min(view.nbytes, self._early.nbytes)
        view[:count] = self._early[:count]
        self._early = self._early[count:]
        while count < view.nbytes:
            view = view[count:]
            count = self._socket.recv_into(view, 0, socket.MSG_WAITALL)
            if not count:
                raise EOFError


class BufferPool:
    """Buffers to receive into, used anew as soon as nobody holds what was received in them.

    A fresh buffer for each image costs more in page faults than its bytes in copying.
    """

    def __init__(self) -> None:
        self._buffers: list[Buffer] = []

    def take(self, size: int) -> Buffer:
        """``size`` bytes that nobody else holds."""
        indices = range(len(self._buffers))
        free = [i for i in indices if _references(self._buffers, i) == _UNHELD]
        fitting = [i for i in free if size <= self._buffers[i].nbytes <= 2 * size][:_SPARE]
        buffer = self._buffers[fitting[0]] if fitting else np.empty(size, np.uint8)
        kept = [self._buffers[i] for i in indices if i in fitting or i not in free]
        self._buffers = kept if fitting else [*kept[-_MOST_HELD:], buffer]
        return buffer[:size]


def _references(buffers: list[Buffer], index: int) -> int:
    return sys.getrefcount(buffers[index])


_UNHELD = _references([np.empty(1, np.uint8)], 0)


class _Sliceable(np.ndarray[Any, Any]):
    """Bytes that genpy's code can slice without copying them, and read text from."""

    def decode(self, *args: str) -> str:
        return self.tobytes().decode(*args)


def _serialize(message: Any) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()
