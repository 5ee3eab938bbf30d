"""The controls of a V4L2 device, such as brightness and exposure, by the names of v4l2-ctl.

Source: linux/videodev2.h, VIDIOC_QUERYCTRL, VIDIOC_QUERYMENU, VIDIOC_G_CTRL and VIDIOC_S_CTRL.
"""

from __future__ import annotations

import errno
import fcntl
import keyword
import os
import re
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from enum import Enum
from typing import Any, NamedTuple

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Value, param, plain_of

GROUP = "device"
"""The group of the parameters that are controls."""

_QUERY = struct.Struct("=II32siiiiI8x")  # id, type, name, minimum, maximum, step, default, flags
_MENU_QUERY = struct.Struct("=II32s4x")  # id, index, name or, of a menu of numbers, the number
_VALUE = struct.Struct("=Ii")  # id, value
_NEXT = 0x80000000
_INTEGER, _BOOLEAN, _MENU, _INTEGER_MENU = 1, 2, 3, 9
_DISABLED, _READ_ONLY = 0x1, 0x4


def _both_ways(number: int, size: int) -> int:
    """The request of an ioctl that reads and writes a structure of that many bytes."""
    return 3 << 30 | size << 16 | ord("V") << 8 | number


QUERYCTRL = _both_ways(36, _QUERY.size)
QUERYMENU = _both_ways(37, _MENU_QUERY.size)
G_CTRL = _both_ways(27, _VALUE.size)
S_CTRL = _both_ways(28, _VALUE.size)


class Control(NamedTuple):
    """A control of a device: its number and type, and its range of values.

    ``choices`` are the entries of a menu: text -> value.
    """

    id: int
    type: int
    minimum: int
    maximum: int
    choices: Mapping[str, int]


def control_params(device: str) -> list[tuple[str, type, Any]]:
    """The controls of a device as fields of a params class, with the values that they have now.

    Empty for a device that cannot be opened: the error is reported where it is opened.
    """
    with suppress(OSError), _opened(device) as file:
        there = _controls_of(file).items()
        return [field for item in there if (field := _field(file, *item)) is not None]
    return []


def set_controls(device: str, wanted: Mapping[str, Value]) -> None:
    """Set controls of a device that may be streaming; the others stay as they are.

    Switches and menus come first: they decide whether a number may be set, as that of an exposure.

    Raises:
        ParameterError: the device rejects some of them now; the rest are set.
    """
    if not wanted:
        return
    try:
        with _opened(device) as file:
            there = _controls_of(file)
            known = {name: there[name] for name in wanted if name in there}
            order = sorted(known, key=lambda name: known[name].type == _INTEGER)
            rejected = [f"no control {name!r}" for name in wanted if name not in known]
            rejected += [_set(file, known[name], name, wanted[name]) for name in order]
    except OSError as error:
        raise ParameterError(f"{device}: {error.strerror}; its controls cannot be set") from None
    if any(rejected):
        raise ParameterError(f"{device}: {'; '.join(filter(None, rejected))}")


def _controls_of(file: int) -> dict[str, Control]:
    """The controls that can be set, by name."""
    found: dict[str, Control] = {}
    last = 0
    while True:
        query = bytearray(_QUERY.pack(last | _NEXT, 0, b"", 0, 0, 0, 0, 0))
        try:
            fcntl.ioctl(file, QUERYCTRL, query)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):  # that was the last, or it has none
                return found
            raise
        last, kind, name, minimum, maximum, _, _, flags = _QUERY.unpack(query)
        if minimum >= maximum or flags & (_DISABLED | _READ_ONLY):
            continue
        choices: dict[str, int] = {}
        if kind in (_MENU, _INTEGER_MENU):
            choices = _choices(file, last, kind, range(minimum, maximum + 1))
        if choices or kind in (_INTEGER, _BOOLEAN):  # no buttons, texts, bits
            found[_short(name)] = Control(last, kind, minimum, maximum, choices)


def _choices(file: int, id: int, kind: int, values: range) -> dict[str, int]:
    """The entries of a menu, which may have gaps."""
    found: dict[str, int] = {}
    for value in values:
        query = bytearray(_MENU_QUERY.pack(id, value, b""))
        with suppress(OSError):
            fcntl.ioctl(file, QUERYMENU, query)
            _, _, entry = _MENU_QUERY.unpack(query)
            number = int.from_bytes(entry[:8], "little", signed=True)
            found.setdefault(_short(entry) if kind == _MENU else str(number), value)
    return found


def _field(file: int, name: str, control: Control) -> tuple[str, type, Any] | None:
    """A control as a field; None if its value cannot be read."""
    value = bytearray(_VALUE.pack(control.id, 0))
    try:
        fcntl.ioctl(file, G_CTRL, value)
    except OSError:
        return None
    _, now = _VALUE.unpack(value)
    help = f"{name.replace('_', ' ')} of the device"
    if control.type == _BOOLEAN:
        return name, bool, param(bool(now), help, group=GROUP)
    if control.type == _INTEGER:
        low, high = control.minimum, control.maximum
        return name, int, param(min(max(now, low), high), help, min=low, max=high, group=GROUP)
    members = [(f"CHOICE_{value}", text) for text, value in control.choices.items()]
    kind: Any = Enum(name, members)  # type: ignore[misc]  # known only now
    chosen = next((text for text, value in control.choices.items() if value == now), members[0][1])
    return name, kind, param(kind(chosen), help, group=GROUP)


def _set(file: int, control: Control, name: str, value: Value) -> str:
    """Set a control; returns why the device rejects it, else an empty text."""
    shown = plain_of(value)
    if control.choices and shown not in control.choices:
        return f"{name}={shown}: choose one of {', '.join(control.choices)}"
    number = control.choices[str(shown)] if control.choices else int(shown)
    try:
        fcntl.ioctl(file, S_CTRL, bytearray(_VALUE.pack(control.id, number)))
    except OSError as error:
        hint = "first switch off the automatic mode, such as auto_exposure"
        return f"{name}={shown}: {error.strerror}; {hint}"
    return ""


def _short(name: bytes) -> str:
    """``Exposure, Auto`` as v4l2-ctl calls it, ``exposure_auto``, so that a field may be named."""
    text = name.partition(b"\0")[0].decode("ascii", "replace").lower()
    short = re.sub(r"[^a-z0-9]+", "_", text).strip("_")
    return short if short.isidentifier() and not keyword.iskeyword(short) else f"control_{short}"


@contextmanager
def _opened(device: str) -> Iterator[int]:
    file = os.open(device, os.O_RDWR | os.O_NONBLOCK)
    try:
        yield file
    finally:
        os.close(file)
