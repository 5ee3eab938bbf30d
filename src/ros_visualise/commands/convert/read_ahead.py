"""Reading on a thread of its own, while somebody works on what was read before."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import closing
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Image
from ros_visualise.sources.recordings import Entry

_AHEAD_BYTES = 32 << 20
_BATCH_BYTES = 256 << 10


class ReadAhead:
    """What a generator gives, a little ahead of who takes it.

    Messages are handed over many at a time: threads that hand over each for itself would spend
    more time on waking each other up than on small messages. Images are decoded here.
    """

    def __init__(self, entries: Generator[Entry, None, None]) -> None:
        self._entries = entries
        self._ready: deque[tuple[int, list[Entry]]] = deque()
        self._ready_bytes = 0
        self._ended = self._stopped = False
        self._error: BaseException | None = None
        self._changed = threading.Condition()
        self._thread = supervision.start("reader", self._read)

    def __iter__(self) -> Iterator[Entry]:
        while (batch := self._take()) is not None:
            yield from batch
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """End reading; what was read and not taken is let go."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        self._thread.join()

    def _take(self) -> list[Entry] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._ready or self._ended)
            if not self._ready:
                return None
            size, batch = self._ready.popleft()
            self._ready_bytes -= size
            self._changed.notify_all()
            return batch

    def _read(self) -> None:
        try:
            with closing(self._entries):
                self._read_all()
        except BaseException as error:
            self._error = error
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _read_all(self) -> None:
        batch: list[Entry] = []
        size = 0
        for entry in self._entries:
            batch.append(entry)
            size += _prepare(entry.message)
            if size >= _BATCH_BYTES:
                if not self._put(size, batch):
                    return
                batch, size = [], 0
        self._put(size, batch)

    def _put(self, size: int, batch: list[Entry]) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._ready_bytes < _AHEAD_BYTES or self._stopped)
            self._ready.append((size, batch))
            self._ready_bytes += size
            self._changed.notify_all()
            return not self._stopped


def _prepare(message: Any) -> int:
    """Decode what waits for it; about the bytes that it takes."""
    if isinstance(message, Image):
        with contextlib.suppress(DamagedMessage):  # who takes it meets it again
            _ = message.pixels
    return int(message.nbytes)
