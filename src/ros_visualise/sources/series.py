"""Topics whose messages are made from files or tables on demand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Floats, Header, NavSatFix
from ros_visualise.messages.recorded import TopicType

_FIX, _NO_FIX = 0, -1
_GPS = "gps"  # the frame of the antenna


@dataclass(frozen=True, eq=False)
class Series:
    """The messages of one topic.

    Attributes:
        kind: their class, one of `ros_visualise.data`.
        stamps_ns: (N,), in any order.
        make: message number i; it may raise `DamagedFile`.
        slow: it reads a file, so that it is worth doing ahead in another thread.
        latched: late subscribers get the last one.
        ros: their type, where it does not follow from the class.
    """

    topic: str
    kind: type[Any]
    stamps_ns: npt.NDArray[np.int64]
    make: Callable[[int], Any]
    slow: bool = False
    latched: bool = False
    ros: TopicType | None = None


def single(topic: str, message: Any, stamp_ns: int) -> Series:
    """One latched message."""
    stamps_ns = np.array([stamp_ns], np.int64)
    return Series(topic, type(message), stamps_ns, lambda _: message, latched=True)


def fix_series(
    topic: str, stamps_ns: npt.NDArray[np.int64], places: Floats, known: npt.NDArray[np.bool_]
) -> Series:
    """GPS fixes: latitude, longitude, altitude (N, 3), and whether there is a fix (N,)."""

    def fix(index: int) -> NavSatFix:
        latitude, longitude, altitude = places[index].tolist()
        header = Header(int(stamps_ns[index]), _GPS)
        status = _FIX if known[index] else _NO_FIX
        return NavSatFix(latitude, longitude, altitude, status=status, header=header)

    return Series(topic, NavSatFix, stamps_ns, fix)


class DamagedFile(DamagedMessage):
    """A file, or a part of it, cannot be read; ``size`` is the number of lost bytes."""

    def __init__(self, path: Path, why: str, size: int | None = None) -> None:
        super().__init__(f"{path}: {why}")
        self.path, self.why = path, why
        whole = path.stat().st_size if path.is_file() else 0
        self.size = whole if size is None else size
