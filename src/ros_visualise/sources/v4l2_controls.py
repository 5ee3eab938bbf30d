"""The controls of a V4L2 device, such as brightness and exposure, by the names of v4l2-ctl.

Source: linux/videodev2.h, VIDIOC_QUERYCTRL and VIDIOC_S_CTRL.
"""

from __future__ import annotations

import fcntl
import os
import re
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from ros_visualise.errors import OpenError

_QUERY = struct.Struct("=II32siiiiI8x")  # id, type, name, minimum, maximum, step, default, flags
_SET = struct.Struct("=Ii")  # id, value
_NEXT = 0x80000000
_SETTABLE = (1, 2, 3, 8, 9)  # whole numbers, switches, menus and bits; no buttons, no texts
_DISABLED, _READ_ONLY = 0x1, 0x4


def _both_ways(number: int, size: int) -> int:
    """The request of an ioctl that reads and writes a structure of that many bytes."""
    return 3 << 30 | size << 16 | ord("V") << 8 | number


QUERYCTRL = _both_ways(36, _QUERY.size)
S_CTRL = _both_ways(28, _SET.size)

Ioctl = Callable[[int, int, bytearray], object]


class Control(NamedTuple):
    """A control of a device: its number there, and the values that it takes, both included."""

    id: int
    minimum: int
    maximum: int


def parse_controls(text: str) -> dict[str, int]:
    """``auto_exposure=1,exposure_time_absolute=200`` as name -> value, in that order.

    Raises:
        OpenError: it is not of that form.
    """
    found = {}
    for pair in filter(None, (one.strip() for one in text.split(","))):
        match = re.fullmatch(r"(\w+)\s*=\s*(-?\d+)", pair)
        if match is None:
            raise OpenError(f"controls={text}: give NAME=NUMBER,... as `v4l2-ctl -l` lists them")
        found[match[1]] = int(match[2])
    return found


def apply_controls(device: str, wanted: Mapping[str, int], ioctl: Ioctl = fcntl.ioctl) -> None:
    """Set controls of a device one after the other; the others stay as they are.

    Args:
        device: such as ``/dev/video0``; somebody may be streaming from it.
        wanted: name -> value.
        ioctl: what asks the kernel.

    Raises:
        OpenError: the device lacks one, or refuses a value.
    """
    if not wanted:
        return
    with _opened(device) as file:
        there = controls_of(file, ioctl)
        for name, value in wanted.items():
            _set(file, device, there, name, value, ioctl)


def controls_of(file: int, ioctl: Ioctl = fcntl.ioctl) -> dict[str, Control]:
    """The controls of an open device that can be set, by name."""
    found: dict[str, Control] = {}
    last = 0
    while True:
        query = bytearray(_QUERY.pack(last | _NEXT, 0, b"", 0, 0, 0, 0, 0))
        try:
            ioctl(file, QUERYCTRL, query)
        except OSError:  # that was the last
            return found
        last, kind, name, minimum, maximum, _, _, flags = _QUERY.unpack(query)
        if kind in _SETTABLE and not flags & (_DISABLED | _READ_ONLY):
            found[_short(name)] = Control(last, minimum, maximum)


def _set(
    file: int, device: str, there: Mapping[str, Control], name: str, value: int, ioctl: Ioctl
) -> None:
    control = there.get(name)
    if control is None:
        known = ", ".join(there) or "none"
        raise OpenError(f"{device} has no control {name!r}; there is {known}")
    if not control.minimum <= value <= control.maximum:
        limits = f"from {control.minimum} to {control.maximum}"
        raise OpenError(f"{device}: {name}={value}: must be {limits}")
    try:
        ioctl(file, S_CTRL, bytearray(_SET.pack(control.id, value)))
    except OSError as error:
        raise OpenError(
            f"{device}: {name}={value}: {error.strerror}; switch off first what sets it by itself,"
            " such as auto_exposure"
        ) from None


def _short(name: bytes) -> str:
    """``Exposure, Auto`` as v4l2-ctl calls it, ``exposure_auto``."""
    text = name.partition(b"\0")[0].decode("ascii", "replace").lower()
    return re.sub(r"[^a-z0-9]+", "_", text).strip("_")


@contextmanager
def _opened(device: str) -> Iterator[int]:
    try:
        file = os.open(device, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        raise OpenError(f"{device}: {error.strerror}; its controls cannot be set") from None
    try:
        yield file
    finally:
        os.close(file)
