"""Series as a recording: an index over them, and reading ahead of it."""

from __future__ import annotations

import logging
import os
import threading
from collections import deque
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import closing
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sources.recordings import Entry, Extra, Loss, TopicInfo
from ros_visualise.sources.series import DamagedFile, Series

log = logging.getLogger(__name__)

_AHEAD = 12  # files that are read, checked and decoded while those before are still in use
_MOST_WORKERS = 5

opened_before = ContextVar("opened_before", default=False)
"""True while a recording is opened that is open already: its notes have been logged."""
_Row = tuple[Series, int]
"""A series, and the number of a message in it."""


class SeriesRecording:
    """A `ros_visualise.sources.recordings.Recording` whose messages are those of its series.

    They are messages of `ros_visualise.data`, made on demand; those of slow series a little ahead.

    Attributes:
        notes: what it lacks and what was done about it, a line each; none is a loss.
    """

    compression = "none"

    def __init__(
        self,
        path: Path,
        format: str,
        size: int,
        series: Sequence[Series],
        notes: Sequence[str] = (),
        damaged: Sequence[tuple[DamagedFile, int]] = (),
        loss: Loss | None = None,
    ) -> None:
        self.path, self.format, self.size = path, format, size
        series = [one for one in series if len(one.stamps_ns)]
        self.notes = list(notes)
        self.loss = Loss() if loss is None else loss
        self.topics: Mapping[str, TopicInfo] = {
            one.topic: TopicInfo(
                one.ros or TopicType(one.kind.type_name, qos=LATCHED if one.latched else VOLATILE),
                len(one.stamps_ns),
            )
            for one in sorted(series, key=lambda one: one.topic)
        }
        self._series = series
        none = np.zeros(0, np.int64)
        stamps_ns = np.concatenate([none, *(one.stamps_ns for one in series)])
        which = [np.full(len(one.stamps_ns), i, np.int64) for i, one in enumerate(series)]
        numbers = [np.arange(len(one.stamps_ns)) for one in series]
        order = np.argsort(stamps_ns, kind="stable")  # of equal stamps, in the order of the series
        self._stamps_ns = stamps_ns[order]
        self._which = np.concatenate([none, *which])[order]
        self._numbers = np.concatenate([none, *numbers])[order]
        self.start_ns = int(self._stamps_ns[0]) if len(order) else 0
        self.end_ns = int(self._stamps_ns[-1]) if len(order) else 0
        self._lost: set[Path] = set()
        self._damaged: dict[Path, tuple[int, list[str]]] = {}
        self._pool = ThreadPoolExecutor(min(_MOST_WORKERS, 1 + (os.cpu_count() or 1)), "series")
        self._lock = threading.Lock()
        self._closed = False
        for error, messages in damaged:
            self._lose(error, messages)
        for note in () if opened_before.get() else self.notes:
            log.warning("%s: %s", path, note)

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """The messages in order of their stamps; damaged files are skipped and counted."""
        with closing(self._read_ahead(self._rows(start_ns, stop_ns, topics))) as items:
            for (series, number), future in items:
                if self._closed:
                    return
                try:
                    message = series.make(number) if future is None else future.result()
                except DamagedFile as error:
                    self._lose(error)
                except CancelledError:
                    return
                else:
                    yield Entry(series.topic, int(series.stamps_ns[number]), message)

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        return {one.topic: np.sort(one.stamps_ns) for one in self._series}

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        with self._lock:
            self._closed = True
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _rows(
        self, start_ns: int | None, stop_ns: int | None, topics: Collection[str] | None
    ) -> Iterator[_Row]:
        stamps = self._stamps_ns
        begin = 0 if start_ns is None else int(np.searchsorted(stamps, start_ns))
        end = len(stamps) if stop_ns is None else int(np.searchsorted(stamps, stop_ns))
        wanted = [topics is None or one.topic in topics for one in self._series]
        for row in range(begin, end):
            which = int(self._which[row])
            if wanted[which]:
                yield self._series[which], int(self._numbers[row])

    def _read_ahead(
        self, rows: Iterator[_Row]
    ) -> Generator[tuple[_Row, Future[Any] | None], None, None]:
        """The rows, with futures of those messages that are made ahead."""
        waiting: deque[tuple[_Row, Future[Any] | None]] = deque()
        slow = 0
        try:
            for row in rows:
                waiting.append((row, self._make_ahead(*row)))
                slow += row[0].slow
                while waiting and (slow > _AHEAD or not slow):
                    slow -= waiting[0][0][0].slow
                    yield waiting.popleft()
            yield from waiting
        finally:
            for _, future in waiting:
                if future is not None:
                    future.cancel()

    def _make_ahead(self, series: Series, number: int) -> Future[Any] | None:
        with self._lock:
            if self._closed or not series.slow:
                return None
            return self._pool.submit(series.make, number)

    def _lose(self, error: DamagedFile, messages: int = 1) -> None:
        if error.path in self._lost:  # when it is read again
            return
        self._lost.add(error.path)
        self.loss.add("", messages, error.size)
        notes = self.loss.notes  # one for each folder, with its first damaged file
        place, errors = self._damaged.setdefault(error.path.parent, (len(notes), []))
        errors.append(str(error).removeprefix(f"{self.path}{os.sep}"))
        more = f"; {len(errors)} such files skipped" if len(errors) > 1 else ""
        notes[place : place + 1] = [f"{errors[0]}{more}"]
