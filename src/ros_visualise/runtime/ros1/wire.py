"""ROS 1's wire format for messages whose data is large: written and read without a copy.

On the wire a message is its length, four bytes, and its fields in order. The large field, ``data``,
is left where it is: what stands before and after it is serialized by the message's own class.
"""

from __future__ import annotations

import copy
import struct
from io import BytesIO
from typing import Any, NamedTuple

import genpy
import numpy as np

from ros_visualise.runtime.memory import Buffer

_AFTER_DATA = {
    "sensor_msgs/Image": 0,
    "sensor_msgs/CompressedImage": 0,
    "sensor_msgs/PointCloud2": 1,
}
"""The types with a large field ``data`` -> how many bytes follow it."""

LENGTH = struct.Struct("<I")


class Parcel(NamedTuple):
    """A message as it goes out: the buffers that make it up, and their length."""

    buffers: list[memoryview]
    size: int


def is_large(message_class: Any) -> bool:
    """True if messages of that class have a large field ``data``."""
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
        return Parcel([memoryview(LENGTH.pack(len(body)) + body)], len(body) + 4)
    data = as_bytes(message.data)
    empty = copy.copy(message)
    empty.data = b""
    body = _serialize(empty)
    cut = len(body) - _AFTER_DATA[message._type]
    size = len(body) + data.nbytes
    head = LENGTH.pack(size) + body[: cut - 4] + LENGTH.pack(data.nbytes)
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
    (announced,) = LENGTH.unpack_from(body.data, after_length - 4)
    if announced != message.data.nbytes:
        raise genpy.DeserializationError(f"{announced} bytes of data are announced")
    return message


class _Sliceable(np.ndarray[Any, Any]):
    """Bytes that genpy's code can slice without copying them, and read text from."""

    def decode(self, *args: str) -> str:
        return self.tobytes().decode(*args)


def _serialize(message: Any) -> bytes:
    buffer = BytesIO()
    try:
        message.serialize(buffer)
    except genpy.SerializationError:
        raise
    except Exception as error:  # genpy raises what it happens to meet
        raise genpy.SerializationError(str(error)) from error
    return buffer.getvalue()
