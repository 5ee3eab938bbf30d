"""Topics whose messages are made from files or tables when somebody reads them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.recorded import TopicType


@dataclass(frozen=True, eq=False)
class Series:
    """The messages of one topic.

    Attributes:
        kind: their class, one of `ros_visualise.data`.
        stamps_ns: (N,), in any order.
        make: message number i; it may raise `DamagedFile`.
        slow: it reads a file, so that it is worth doing ahead in another thread.
        latched: whoever comes late gets the last one.
        ros: their type, where their class does not say it.
    """

    topic: str
    kind: type
    stamps_ns: npt.NDArray[np.int64]
    make: Callable[[int], Any]
    slow: bool = False
    latched: bool = False
    ros: TopicType | None = None


def single(topic: str, message: Any, stamp_ns: int) -> Series:
    """One latched message."""
    stamps_ns = np.array([stamp_ns], np.int64)
    return Series(topic, type(message), stamps_ns, lambda _: message, latched=True)


class DamagedFile(DamagedMessage):
    """A file, or a part of it, cannot be read; ``size`` are the bytes of what cannot."""

    def __init__(self, path: Path, why: str, size: int | None = None) -> None:
        super().__init__(f"{path}: {why}")
        self.path, self.why = path, why
        whole = path.stat().st_size if path.is_file() else 0
        self.size = whole if size is None else size
