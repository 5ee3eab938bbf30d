"""The messages of many chunks in order of time, with no more of the index in memory than needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ros_visualise.sources.recordings.rosbag1.chunks import ENTRY, Chunk

_PLACED = np.dtype([*ENTRY.descr, ("chunk", "<u4")])
_AT_ONCE = 4096

Place = tuple[int, int, int, int]
"""Stamp, connection, offset in the chunk, and which of the chunks."""


def in_time_order(
    chunks: Sequence[Chunk], load: Callable[[Chunk], NDArray[Any]]
) -> Iterator[Place]:
    """The messages of chunks given in the file's order; of equal stamps, in the file's order.

    Args:
        load: the messages of a chunk, called when the chunk's time has come.
    """
    waiting = sorted(range(len(chunks)), key=lambda number: chunks[number].start_ns)
    pool = np.empty(0, _PLACED)
    opened = 0
    while opened < len(waiting) or len(pool):
        now_ns = pool["stamp_ns"][0] if len(pool) else chunks[waiting[opened]].start_ns
        fresh = [pool]
        while opened < len(waiting) and chunks[waiting[opened]].start_ns <= now_ns:
            fresh.append(_placed(load(chunks[waiting[opened]]), waiting[opened]))
            opened += 1
        if len(fresh) > 1:
            pool = np.concatenate(fresh)
            pool = pool[np.lexsort((pool["offset"], pool["chunk"], pool["stamp_ns"]))]
        ready = len(pool)
        if opened < len(waiting):
            ready = int(np.searchsorted(pool["stamp_ns"], chunks[waiting[opened]].start_ns))
        for first in range(0, ready, _AT_ONCE):
            yield from pool[first : min(ready, first + _AT_ONCE)].tolist()
        pool = pool[ready:]


def _placed(entries: NDArray[Any], number: int) -> NDArray[Any]:
    placed = np.empty(len(entries), _PLACED)
    for name in ENTRY.names or ():
        placed[name] = entries[name]
    placed["chunk"] = number
    return placed
