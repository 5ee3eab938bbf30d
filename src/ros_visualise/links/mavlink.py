"""Frames of MAVLink 1 and 2, and the fields of its messages.

Source: mavlink.io, Packet Serialization; the definitions are those of ArduPilot's dialect, which
includes all common messages.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ros_visualise.core.errors import OpenError

MARKS = (0xFE, 0xFD)
"""First byte of a frame of MAVLink 1 and 2."""

_INSTALL = "pip install 'ros_visualise[drone]' (in a clone: pip install '.[drone]')"
_SIGNED, _SIGNATURE = 1, 13
_LONGEST = 10 + 255 + 2 + _SIGNATURE
_MARK = re.compile(b"[\xfd\xfe]")
_DTYPES = {"float": "f4", "double": "f8", "char": "u1", "uint8_t_mavlink_version": "u1"}


@cache
def dialect() -> Any:
    """The messages and enumerations of MAVLink; raises OpenError if pymavlink is missing."""
    try:
        return import_module("pymavlink.dialects.v20.ardupilotmega")
    except ImportError as error:
        raise OpenError(f"MAVLink needs pymavlink: {_INSTALL} ({error})") from None


@cache
def _crc() -> Any:
    return import_module("pymavlink.generator.mavcrc").x25crc


class MavlinkFrame(NamedTuple):
    """One frame: where it ends, its sender, and its message as it lies in it."""

    end: int
    system: int
    component: int
    number: int
    payload: bytes


def frame_at(data: bytes, place: int) -> MavlinkFrame | None:
    """The frame that begins at a place; None without a whole one."""
    head = data[place : place + 10]
    if len(head) < 8 or head[0] not in MARKS:
        return None
    is_first = head[0] == MARKS[0]
    begin = place + (6 if is_first else 10)
    end = begin + head[1] + 2
    if not is_first and head[2] & _SIGNED:
        end += _SIGNATURE
    if end > len(data) or len(head) < begin - place:
        return None
    system, component, number = head[3:6] if is_first else head[5:8]
    if not is_first:
        number |= head[8] << 8 | head[9] << 16
    return MavlinkFrame(end, system, component, number, data[begin : begin + head[1]])


def is_whole(data: bytes, place: int, frame: MavlinkFrame) -> bool:
    """True if the checksum of a frame is right; unknown messages have none that can be tested."""
    kind = dialect().mavlink_map.get(frame.number)
    end = place + (6 if data[place] == MARKS[0] else 10) + len(frame.payload)
    if kind is None:
        return True
    checksum = _crc()(data[place + 1 : end])
    checksum.accumulate(bytes([kind.crc_extra]))
    return bool(checksum.crc == data[end] | data[end + 1] << 8)


class MavlinkStream:
    """Messages in what comes over a line; whole ones are found again after any damage.

    Attributes:
        damaged: number of bytes that belong to no known message.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b""
        self._decoder = dialect().MAVLink(None)

    def feed(self, data: bytes, is_datagram: bool) -> list[Any]:
        """The messages that these bytes end; frames do not go on in the next datagram."""
        data, found, place = self._rest + data, [], 0
        while (mark := _MARK.search(data, place)) is not None:
            self.damaged += mark.start() - place
            place = mark.start()
            frame = frame_at(data, place)
            if frame is None and not is_datagram and len(data) - place < _LONGEST:
                break  # the rest comes
            message = None if frame is None else self._decoded(data, place, frame)
            if frame is None or message is None:
                self.damaged += 1
                place += 1
                continue
            found.append(message)
            place = frame.end
        self._rest = data[place:] if mark is not None else b""
        self.damaged += len(data) - place - len(self._rest)
        return found

    def _decoded(self, data: bytes, place: int, frame: MavlinkFrame) -> Any:
        if layout(frame.number) is None or not is_whole(data, place, frame):
            return None
        try:
            return self._decoder.decode(bytearray(data[place : frame.end]))
        except (dialect().MAVError, UnicodeDecodeError):
            return None


class MessageLayout(NamedTuple):
    """A message: its name, its bytes, and type, size of array (0: none) and name of its fields."""

    name: str
    dtype: np.dtype[np.void]
    fields: list[tuple[str, int, str]]


@cache
def layout(number: int) -> MessageLayout | None:
    """The message of a number; None if it is unknown."""
    kind = dialect().mavlink_map.get(number)
    if kind is None:
        return None
    sizes = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
    fields = []
    columns: list[tuple[str, str]] = []
    for name in kind.ordered_fieldnames:
        size, dtype = sizes[name], np.dtype(_DTYPES.get(types[name], types[name][:-2]))
        is_text = types[name] == "char" and size
        fields.append(("string" if is_text else dtype.name, 0 if is_text else size, name))
        if is_text:
            columns.append((name, f"S{size}"))
        else:
            names = [f"{name}[{n}]" for n in range(size)] if size else [name]
            columns += [(one, dtype.newbyteorder("<").str) for one in names]
    return MessageLayout(str(kind.msgname), np.dtype(columns), fields)
