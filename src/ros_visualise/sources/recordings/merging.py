"""One stream in order of time out of pieces that overlap, and a recording made of files of them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from heapq import heappop, heappush
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ros_visualise.sources.recordings import Entry, Extra, Loss, TopicInfo
from ros_visualise.sources.recordings.calibrations import calibrated
from ros_visualise.sources.recordings.shelf import Shelf
from ros_visualise.sources.recordings.storage import (
    LATEST_NS,
    Piece,
    Query,
    Storage,
)
from ros_visualise.sources.recordings.topics import Topics


def merge(starts_ns: npt.NDArray[np.int64], open_piece: Callable[[int], Piece]) -> Iterator[Entry]:
    """All entries of all pieces in order of their stamps; of equal ones, the first piece's first.

    A piece is opened when its time has come and let go of at its end: at no time are more open
    than overlap.

    Args:
        starts_ns: (N,) the first stamp of each piece, or one before it.
        open_piece: reads the piece of a number.
    """
    waiting = np.argsort(starts_ns, kind="stable")[::-1].tolist()
    running: list[tuple[int, int, Piece]] = []
    while waiting or running:
        if waiting and (not running or (int(starts_ns[waiting[-1]]), waiting[-1]) < running[0][:2]):
            number = waiting.pop()
            piece = open_piece(number)
        else:
            _, number, piece = heappop(running)
            following = [running[0][:2]] if running else []
            following += [(int(starts_ns[waiting[-1]]), waiting[-1])] if waiting else []
            stamp_ns, other = min(following, default=(LATEST_NS, 0))
            yield from piece.read(stamp_ns + (number < other))
        if piece.stamp_ns is not None:
            heappush(running, (piece.stamp_ns, number, piece))


class MergedRecording:
    """A `Recording` of one or several files.

    Args:
        path, format: as `Recording` has them.
        storages: its files, in their order.
        loss: to which the files add what they cannot read.
        release: called when it is closed.
        compression: that of the files as a whole; empty: they tell.
        extras: what it holds beside its files.
    """

    def __init__(
        self,
        path: Path,
        format: str,
        storages: Sequence[Storage],
        loss: Loss,
        release: Callable[[], None] = lambda: None,
        compression: str = "",
        extras: Sequence[Extra] = (),
    ) -> None:
        self.path, self.format, self.loss = path, format, loss
        self.size = sum(storage.size for storage in storages)
        self._compression, self._extras = compression, extras
        topics = Topics(storages, loss)
        self.topics: Mapping[str, TopicInfo] = topics.by_name
        self._chosen = topics.chosen
        spans = [(s.starts_ns.min(), s.ends_ns.max()) for s in storages if len(s.starts_ns)]
        self.start_ns = int(min((start for start, _ in spans), default=0))
        self.end_ns = int(max((end for _, end in spans), default=0))
        self._storages = storages
        self._release = release
        self._closed = threading.Event()

    @property
    def compression(self) -> str:
        """As `Recording.compression`."""
        found = {name for storage in self._storages for name in storage.compressions}
        return self._compression or ", ".join(sorted(found))

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        """As `Recording.read`."""
        return calibrated(self._read, self.topics, start_ns, stop_ns, topics)

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        """As `Recording.stamps_ns`."""
        found: dict[str, list[npt.NDArray[np.int64]]] = {topic: [] for topic in self.topics}
        query = Query(chosen=self._chosen)
        for storage in self._storages:
            for number, stamps_ns in storage.stamps_ns():
                channel = storage.channels.get(number)
                if channel is not None and query.asks_for(channel):
                    found[channel.topic].append(stamps_ns)
        empty = np.empty(0, np.int64)
        return {topic: np.sort(np.concatenate([empty, *parts])) for topic, parts in found.items()}

    def extras(self) -> Iterator[Extra]:
        """As `Recording.extras`."""
        return chain(self._extras, *(storage.extras() for storage in self._storages))

    def close(self) -> None:
        """As `Recording.close`."""
        self._closed.set()
        for storage in self._storages:
            storage.close()
        self._release()

    def _read(
        self, start_ns: int | None, stop_ns: int | None, topics: Collection[str] | None
    ) -> Generator[Entry, None, None]:
        query = Query(
            -LATEST_NS if start_ns is None else start_ns,
            LATEST_NS if stop_ns is None else stop_ns,
            None if topics is None else frozenset(topics),
            self._chosen,
        )
        is_closed = self._closed.is_set
        for entry in self._merged(query):
            if is_closed():
                return
            yield entry

    def _merged(self, query: Query) -> Iterator[Entry]:
        chosen = [storage.select(query) for storage in self._storages]
        ends = np.cumsum([len(pieces) for pieces in chosen])
        starts_ns = [s.starts_ns[p] for s, p in zip(self._storages, chosen, strict=True)]

        shelf = Shelf()

        def open_piece(number: int) -> Piece:
            file = int(np.searchsorted(ends, number, side="right"))
            piece = chosen[file][number - ends[file]]
            return self._storages[file].open_piece(int(piece), query, shelf)

        return merge(np.concatenate([np.empty(0, np.int64), *starts_ns]), open_piece)
