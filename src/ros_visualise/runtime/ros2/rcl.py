"""Messages as bytes, to and from ROS 2's C library.

rclpy can do both as well, but holds Python's lock meanwhile, so that a publisher that waits for one
subscriber holds up the whole process; and it copies a message twice more each time.

Source: rcl/publisher.h, rcl/subscription.h and rcutils/types/uint8_array.h, which are the same from
Humble on.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from rclpy.impl.implementation_singleton import rclpy_implementation

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.runtime.memory import Buffer, BufferPool

_OK = 0
_NOTHING = 401
"""RCL_RET_SUBSCRIPTION_TAKE_FAILED: there is no message."""

_INFO_BYTES = 256
"""More than an rmw_message_info_t has; it begins with the time at which a message was sent."""

_Reallocate = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)


class RclError(RosVisualiseError):
    """A call of ROS 2's has failed, as those do on a graph that this process has left."""


class Taken(NamedTuple):
    """A message: when it was sent, by its publisher's clock, and its bytes."""

    sent_ns: int
    data: Buffer


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t."""

    _fields_ = [
        ("allocate", ctypes.c_void_p),
        ("deallocate", ctypes.c_void_p),
        ("reallocate", ctypes.c_void_p),
        ("zero_allocate", ctypes.c_void_p),
        ("state", ctypes.c_void_p),
    ]


class _Bytes(ctypes.Structure):
    """rcl_serialized_message_t."""

    _fields_ = [
        ("buffer", ctypes.c_void_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", _Allocator),
    ]


_RCL = ctypes.CDLL("librcl.so")  # rclpy has loaded them
_RCL.rcl_publish_serialized_message.argtypes = [ctypes.c_void_p] * 3
_RCL.rcl_publisher_wait_for_all_acked.argtypes = [ctypes.c_void_p, ctypes.c_int64]
_RCL.rcl_take_serialized_message.argtypes = [ctypes.c_void_p] * 4
_RCUTILS = ctypes.CDLL("librcutils.so")
_RCUTILS.rcutils_get_default_allocator.restype = _Allocator
_DEFAULT: _Allocator = _RCUTILS.rcutils_get_default_allocator()


def publish(publisher: Any, data: Buffer) -> None:
    """Send a message's bytes, and wait until all subscribers have room for them.

    Raises:
        RclError: they cannot be sent.
    """
    message = _Bytes(data.ctypes.data, data.nbytes, data.nbytes, _DEFAULT)
    with _used(publisher) as address:
        _check(_RCL.rcl_publish_serialized_message(address, ctypes.byref(message), None))


def wait_for_all_acked(publisher: Any, timeout_s: float) -> None:
    """Wait until reliable subscribers have got all messages, or for that time."""
    with _used(publisher) as address:
        status = _RCL.rcl_publisher_wait_for_all_acked(address, int(timeout_s * 1e9))
    if status != _OK:  # it took longer, or this is not for a publisher like this one
        _forget_error()


class Taker:
    """Takes the messages of subscriptions, into memory that is used anew when nobody holds it.

    It belongs to one thread.
    """

    def __init__(self) -> None:
        self._pool = BufferPool()
        self._buffer: Buffer = np.empty(0, np.uint8)
        self._info = ctypes.create_string_buffer(_INFO_BYTES)
        self._allocator = _Allocator.from_buffer_copy(_DEFAULT)
        self._reallocate = _Reallocate(self._allocate)  # is called as long as this is held
        self._allocator.reallocate = ctypes.cast(self._reallocate, ctypes.c_void_p)

    def take(self, subscription: Any) -> Taken | None:
        """The next message, if there is one.

        Raises:
            RclError: none can be taken.
        """
        message = _Bytes(None, 0, 0, self._allocator)
        with _used(subscription) as address:
            status = _RCL.rcl_take_serialized_message(
                address, ctypes.byref(message), self._info, None
            )
        buffer, self._buffer = self._buffer, np.empty(0, np.uint8)
        if status == _NOTHING:
            _forget_error()
            return None
        _check(status)
        sent_ns = int.from_bytes(self._info.raw[:8], "little", signed=True)
        return Taken(sent_ns, buffer[: message.length])

    def _allocate(self, _: int, size: int, __: int) -> int:
        """Called with a message's size, before its bytes are copied."""
        self._buffer = self._pool.take(size)
        return int(self._buffer.ctypes.data)


@contextmanager
def _used(entity: Any) -> Iterator[ctypes.c_void_p]:
    """The address of a publisher or subscription, which is not destroyed meanwhile."""
    try:
        with entity.handle:
            yield ctypes.c_void_p(entity.handle.pointer)
    except rclpy_implementation.InvalidHandle as error:
        raise RclError(str(error)) from None


def _check(status: int) -> None:
    if status != _OK:
        _forget_error()
        raise RclError(f"ROS 2 returned error {status}")


def _forget_error() -> None:
    """Else the next error of this thread is reported together with this one."""
    _RCUTILS.rcutils_reset_error()
