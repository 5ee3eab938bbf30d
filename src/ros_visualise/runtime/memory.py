"""Memory: that of freed images is used again, and unused memory is returned to the system."""

from __future__ import annotations

import ctypes
import mmap
import sys
import time
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core import supervision

_LARGEST_BYTES = 16 * 2**20
_TRIM_PERIOD_S = 60.0

SPARE = 3
"""Most buffers that wait to be used again."""

MOST_HELD = 32
"""Most buffers in use that are kept track of."""

_OWN_BYTES = 64 * 1024
"""Smallest size of a buffer with memory of its own."""

Buffer = npt.NDArray[np.uint8]
Trim = Callable[[int], int]


@cache
def manage_memory() -> None:
    """Have the C library keep freed memory for a while, and no longer; done once."""
    keep_freed_images()
    trim = find_trim()
    if trim is not None:
        supervision.start("memory", partial(_trim_regularly, trim))


def keep_freed_images() -> None:
    """Have the C library keep the memory of freed images for the next ones.

    glibc keeps twice as much as the largest block that was ever freed (mallopt(3),
    M_MMAP_THRESHOLD), so a block is allocated and freed at once; it is never touched, and costs
    nothing. Without it a node with images of 8 MB returned their memory each time, and got it again
    as 3,700 empty pages: a tenth of the processor time of separate nodes at 4K. Larger images are
    better off with memory of their own, which NumPy requests in large pages.
    """
    np.empty(_LARGEST_BYTES, np.uint8)


def find_trim() -> Trim | None:
    """glibc's malloc_trim(3), which returns whole unused pages to the system; None without glibc.

    glibc gives each thread a heap. By itself it returns only the ends of these, so that in a
    process of many threads each heap stays as large as it ever was, and together they grow for
    hours.
    """
    try:
        found: Trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None
    return found


def _trim_regularly(trim: Trim) -> None:
    while True:
        time.sleep(_TRIM_PERIOD_S)
        trim(0)


class BufferPool:
    """Buffers to receive into, used again as soon as nobody holds what was received in them.

    A fresh buffer for each image costs more in page faults than its bytes in copying.
    """

    def __init__(self) -> None:
        self._buffers: list[Buffer] = []

    def take(self, size: int) -> Buffer:
        """A buffer of ``size`` bytes that nobody else holds."""
        indices = range(len(self._buffers))
        free = [i for i in indices if not is_held(self._buffers, i)]
        fitting = [i for i in free if size <= self._buffers[i].nbytes <= 2 * size][:SPARE]
        buffer = self._buffers[fitting[0]] if fitting else _make(size)
        kept = [self._buffers[i] for i in indices if i in fitting or i not in free]
        self._buffers = kept if fitting else [*kept[-MOST_HELD:], buffer]
        return buffer[:size]


def _make(size: int) -> Buffer:
    """A buffer whose memory is returned to the system as soon as it is freed.

    The C library would keep it for the thread that received into it, and a thread comes and goes
    with each connection.
    """
    if size < _OWN_BYTES:
        return np.empty(size, np.uint8)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    return np.frombuffer(memory, np.uint8)


def is_held(buffers: Any, key: int) -> bool:
    """True if anybody else holds a part of a buffer in a list or dict."""
    return _references(buffers, key) > _UNHELD


def _references(buffers: Any, key: int) -> int:
    return sys.getrefcount(buffers[key])


_UNHELD = _references([np.empty(1, np.uint8)], 0)
