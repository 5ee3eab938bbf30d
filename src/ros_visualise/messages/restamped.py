"""Messages as if they had been recorded earlier or later, or with other names of frames."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields, is_dataclass, replace
from functools import partial
from typing import Any, TypeVar

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header, MarkerArray, Path
from ros_visualise.messages.recorded import Recorded

T = TypeVar("T")
Later = Callable[[int], int]
Rename = Callable[[str], str]

_NS = 1_000_000_000
_END_S = 2**31  # of what stamps of ROS 2 hold
_TIME = "builtin_interfaces/msg/Time"
_STAMP = "stamp"
_CHILD = "child_frame_id"
_FRAMES = ("frame_id", _CHILD)
_AT = 4  # of the stamp in messages that begin with a header: after the number, or the kind of CDR


def restamped(message: T, by_ns: int, rename: Rename | None = None) -> T:
    """The message with its stamps later by so much, and its frames renamed.

    Recorded ones stay bytes, and their stamps of zero, which mean none unless time itself begins at
    zero, as it does in simulations; those that cannot be decoded stay as they are.
    """
    if not by_ns and rename is None:
        return message
    move = _recorded if isinstance(message, Recorded) else _plain
    moved: T = move(message, by_ns, rename)
    return moved


def _recorded(message: Any, by_ns: int, rename: Rename | None) -> Any:
    data, definitions = message.data, message.definitions
    kinds = definitions.stamped(message.type_name)
    later = partial(_later, by_ns, message.stamp_ns < _NS)
    if kinds == "first" and rename is None:
        data = _patched(data, definitions.encoding == "ros1", later)
    elif kinds:
        with suppress(DamagedMessage):
            data = definitions.write(message.type_name, _moved(message.message, later, rename))
    return Recorded(
        message.type_name,
        data,
        definitions,
        message.stamp_ns + by_ns,
        message.calibration,
        message.publish_ns + by_ns,
        message.sequence,
    )


def _patched(data: bytes | memoryview, is_ros1: bool, later: Later) -> bytes | memoryview:
    """The bytes of a message that begins with its only header."""
    if len(data) < _AT + 8:
        return data
    time = struct.Struct("<II" if is_ros1 or data[1] & 1 else ">II")
    sec, nanosec = time.unpack_from(data, _AT)
    stamp_ns = later(sec * _NS + nanosec)
    patched = bytearray(data)
    time.pack_into(patched, _AT, *divmod(stamp_ns, _NS))
    return bytes(patched)


def _later(by_ns: int, is_zero_a_time: bool, stamp_ns: int) -> int:
    is_time = stamp_ns or is_zero_a_time
    return min(max(stamp_ns + by_ns, 1), _END_S * _NS - 1) if is_time else 0


def _moved(message: Any, later: Later, rename: Rename | None) -> Any:
    """A decoded message, whose stamps and frames are changed in place."""
    for one in fields(message):
        value = getattr(message, one.name)
        kind = getattr(value, "__msgtype__", "")
        if kind == _TIME and one.name == _STAMP:
            stamp_ns = later(value.sec * _NS + value.nanosec)
            sec, nanosec = divmod(stamp_ns, _NS)
            setattr(message, one.name, replace(value, sec=sec, nanosec=nanosec))
        elif kind:
            _moved(value, later, rename)
        elif rename is not None and one.name in _FRAMES and isinstance(value, str):
            setattr(message, one.name, rename(value))
        elif isinstance(value, list):
            for inner in value:
                if is_dataclass(inner):
                    _moved(inner, later, rename)
    return message


def _plain(message: Any, by_ns: int, rename: Rename | None) -> Any:
    """One of `ros_visualise.data`, or a part of one; markers are valid at all times."""
    by_ns = 0 if isinstance(message, MarkerArray) else by_ns
    if isinstance(message, Header):
        frame_id = message.frame_id if rename is None else rename(message.frame_id)
        return replace(message, stamp_ns=max(message.stamp_ns + by_ns, 0), frame_id=frame_id)
    if isinstance(message, tuple):
        return tuple(_plain(one, by_ns, rename) for one in message)
    if not is_dataclass(message) or isinstance(message, type):
        return message
    now = {one.name: getattr(message, one.name) for one in fields(message) if one.init}
    later = {name: _plain(value, by_ns, rename) for name, value in now.items()}
    if rename is not None and isinstance(now.get(_CHILD), str):
        later[_CHILD] = rename(now[_CHILD])
    if isinstance(message, Path):
        later["stamps_ns"] = message.stamps_ns + by_ns
    changed = {name: value for name, value in later.items() if value is not now[name]}
    return replace(message, **changed) if changed else message
