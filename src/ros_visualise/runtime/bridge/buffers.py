"""Memory to receive messages into, used anew when nobody holds what was received in it."""

from __future__ import annotations

import mmap
import sys
from typing import Any

import numpy as np
import numpy.typing as npt

SPARE = 3
"""Buffers that wait to be used anew, at most."""

MOST_HELD = 32
"""Buffers that come back when those who hold them let go, at most."""

_OWN_BYTES = 64 * 1024
"""From this size on a buffer has memory of its own."""

Buffer = npt.NDArray[np.uint8]


class BufferPool:
    """Buffers to receive into, used anew as soon as nobody holds what was received in them.

    A fresh buffer for each image costs more in page faults than its bytes in copying.
    """

    def __init__(self) -> None:
        self._buffers: list[Buffer] = []

    def take(self, size: int) -> Buffer:
        """``size`` bytes that nobody else holds."""
        indices = range(len(self._buffers))
        free = [i for i in indices if not is_held(self._buffers, i)]
        fitting = [i for i in free if size <= self._buffers[i].nbytes <= 2 * size][:SPARE]
        buffer = self._buffers[fitting[0]] if fitting else _make(size)
        kept = [self._buffers[i] for i in indices if i in fitting or i not in free]
        self._buffers = kept if fitting else [*kept[-MOST_HELD:], buffer]
        return buffer[:size]


def _make(size: int) -> Buffer:
    """A buffer whose memory is given back as soon as it is let go of.

    The C library would keep it for the thread that received into it, and a thread comes and goes
    with each connection.
    """
    if size < _OWN_BYTES:
        return np.empty(size, np.uint8)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(memory, np.uint8)


def is_held(buffers: Any, key: int) -> bool:
    """Whether anybody else holds something of a buffer in a list or dict."""
    return _references(buffers, key) > _UNHELD


def _references(buffers: Any, key: int) -> int:
    return sys.getrefcount(buffers[key])


_UNHELD = _references([np.empty(1, np.uint8)], 0)
