"""One stream in order of time out of pieces that overlap, and a recording made of files of them."""

from __future__ import annotations

import re
import threading
from collections import Counter
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from heapq import heappop, heappush
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.messages.calibrations import CAMERA_INFO, calibration_topic
from ros_visualise.messages.qos import LATCHED, VOLATILE
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.recordings import Entry, Extra, Loss, PartialLoss, TopicInfo
from ros_visualise.sources.recordings.pieces import PieceCache
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import (
    LATEST_NS,
    Channel,
    MessageQuery,
    Piece,
    Storage,
)

Read = Callable[[int | None, int | None, Collection[str] | None], Generator[Entry, None, None]]
"""Signature of `Recording.read`."""

_LOOK_BACK_NS = 1_000_000_000
S = TypeVar("S", bound=Storage)


def calibrated(
    read: Read,
    known: Mapping[str, TopicInfo],
    start_ns: int | None,
    stop_ns: int | None,
    wanted: Collection[str] | None,
) -> Generator[Entry, None, None]:
    """The entries of ``read``, each image with its camera's calibration: the last one before it.

    An image before every calibration gets the first one. Calibrations that are not wanted are read
    for the images, and dropped. Times and topics: see `Recording.read`.
    """
    types = {topic: info.type for topic, info in known.items()}
    infos = {
        topic: info
        for topic in types
        if (wanted is None or topic in wanted) and (info := calibration_topic(topic, types))
    }
    topics = None if wanted is None else {*wanted, *infos.values()}
    last: dict[str, Recorded | None] = {}
    with closing(read(start_ns, stop_ns, topics)) as entries:
        for entry in entries:
            message = entry.message
            if isinstance(message, Recorded):
                if message.type_name == CAMERA_INFO.name:
                    last[entry.topic] = message
                elif entry.topic in infos:
                    info = infos[entry.topic]
                    if info not in last:
                        last[info] = _nearest(read, info, start_ns)
                    message.calibration = last[info]
            if wanted is None or entry.topic in wanted:
                yield entry


def _nearest(read: Read, topic: str, time_ns: int | None) -> Recorded | None:
    """The last message before a time, else the first of all."""
    span_ns = _LOOK_BACK_NS
    while time_ns is not None and span_ns < 2 * time_ns:
        found = None
        with closing(read(max(0, time_ns - span_ns), time_ns, [topic])) as entries:
            for entry in entries:
                found = entry.message
        if isinstance(found, Recorded):
            return found
        span_ns *= 8
    with closing(read(None, None, [topic])) as entries:
        first = next(entries, None)
    return first.message if first and isinstance(first.message, Recorded) else None


def merge(starts_ns: npt.NDArray[np.int64], open_piece: Callable[[int], Piece]) -> Iterator[Entry]:
    """All entries of all pieces in order of their stamps; of equal ones, the first piece's first.

    A piece is opened when its time has come and dropped at its end: no more pieces are open at
    the same time than overlap.

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
        path, format: see `Recording`.
        storages: its files, in their order.
        loss: to which the files add their own.
        release: called when it is closed.
        compression: of the files as a whole; empty: their own.
        extras: content beside the files.
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
        self._chosen: dict[str, Channel] = {}
        self.topics: Mapping[str, TopicInfo] = self._find_topics(storages)
        spans = [(s.starts_ns.min(), s.ends_ns.max()) for s in storages if len(s.starts_ns)]
        self.start_ns = int(min((start for start, _ in spans), default=0))
        self.end_ns = int(max((end for _, end in spans), default=0))
        self._storages = storages
        self._release = release
        self._closed = threading.Event()

    @property
    def compression(self) -> str:
        found = {name for storage in self._storages for name in storage.compressions}
        return self._compression or ", ".join(sorted(found))

    def read(
        self,
        start_ns: int | None = None,
        stop_ns: int | None = None,
        topics: Collection[str] | None = None,
    ) -> Generator[Entry, None, None]:
        return calibrated(self._read, self.topics, start_ns, stop_ns, topics)

    def stamps_ns(self) -> Mapping[str, npt.NDArray[np.int64]]:
        found: dict[str, list[npt.NDArray[np.int64]]] = {topic: [] for topic in self.topics}
        query = MessageQuery(chosen=self._chosen)
        for storage in self._storages:
            for number, stamps_ns in storage.stamps_ns():
                channel = storage.channels.get(number)
                if channel is not None and query.selects(channel):
                    found[channel.topic].append(stamps_ns)
        empty = np.empty(0, np.int64)
        return {topic: np.sort(np.concatenate([empty, *parts])) for topic, parts in found.items()}

    def extras(self) -> Iterator[Extra]:
        return chain(self._extras, *(storage.extras() for storage in self._storages))

    def close(self) -> None:
        self._closed.set()
        for storage in self._storages:
            storage.close()
        self._release()

    def _find_topics(self, storages: Sequence[Storage]) -> dict[str, TopicInfo]:
        """The topics of all files; each is of one type, which can be read if any can."""
        found: dict[str, list[tuple[Channel, int]]] = {}
        connections: Counter[str] = Counter()
        for storage in storages:
            for number, channel in storage.channels.items():
                found.setdefault(channel.topic, []).append((channel, storage.counts.get(number, 0)))
            connections |= Counter(channel.topic for channel in storage.channels.values())
        return {
            topic: self._topic(topic, found[topic], connections[topic]) for topic in sorted(found)
        }

    def _topic(
        self, topic: str, channels: Sequence[tuple[Channel, int]], connections: int
    ) -> TopicInfo:
        chosen, _ = min(channels, key=lambda pair: (bool(pair[0].unreadable), not pair[1]))
        self._chosen[topic] = chosen
        alike = [pair for pair in channels if pair[0].is_like(chosen)]
        others = [pair for pair in channels if not pair[0].is_like(chosen)]
        for name in dict.fromkeys(channel.type_name for channel, _ in others):
            count = sum(count for channel, count in others if channel.type_name == name)
            if count:
                self.loss.add(_mixed_types(topic, count, name, chosen.type_name), count)
        return TopicInfo(
            TopicType(
                chosen.type_name,
                chosen.definitions,
                LATCHED if any(channel.latched for channel, _ in alike) else VOLATILE,
                "\n".join(_distinct(channel.offered_qos.strip() for channel, _ in alike)),
                _distinct(channel.callerid for channel, _ in alike),
                tuple(dict(label for channel, _ in alike for label in channel.labels).items()),
            ),
            sum(count for _, count in alike),
            chosen.digest,
            connections,
            chosen.unreadable,
            {channel.type_name: channel.digest for channel, _ in others},
        )

    def _read(
        self, start_ns: int | None, stop_ns: int | None, topics: Collection[str] | None
    ) -> Generator[Entry, None, None]:
        query = MessageQuery(
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

    def _merged(self, query: MessageQuery) -> Iterator[Entry]:
        chosen = [storage.select(query) for storage in self._storages]
        ends = np.cumsum([len(pieces) for pieces in chosen])
        starts_ns = [s.starts_ns[p] for s, p in zip(self._storages, chosen, strict=True)]
        cache = PieceCache()

        def open_piece(number: int) -> Piece:
            file = int(np.searchsorted(ends, number, side="right"))
            piece = chosen[file][number - ends[file]]
            return self._storages[file].open_piece(int(piece), query, cache)

        return merge(np.concatenate([np.empty(0, np.int64), *starts_ns]), open_piece)


def open_storages(
    path: Path,
    files: Sequence[Path],
    open_file: Callable[[Path, Schemas, PartialLoss], S],
    loss: Loss,
    stack: ExitStack,
) -> list[S]:
    """Open the files of a recording; those that cannot be opened are a loss.

    ``open_file`` opens one, as `SqliteFile`; ``stack`` closes all. Raises OpenError if none can be
    opened.
    """
    schemas = Schemas()
    storages: list[S] = []
    failures: list[OpenError] = []
    for file in files:
        part = PartialLoss(loss, "" if file == path else f"{file.name}: ")
        try:
            storages.append(stack.enter_context(closing(open_file(file, schemas, part))))
        except (OpenError, OSError) as error:
            failure = OpenError.unreadable(file, error) if isinstance(error, OSError) else error
            failures.append(failure)
            loss.add(str(failure).replace(f"{file}: ", f"{file.name}: "))
            with suppress(OSError):  # a link to a missing file
                loss.bytes += file.stat().st_size
    if not storages:
        raise failures[0]
    return storages


def missing_parts(files: Sequence[Path]) -> list[str]:
    """The names between those of a bag that was split: ``bag_1.db3`` of ``bag_0`` and ``bag_2``."""
    parts = [re.fullmatch(r"(.*_)(\d+)(\..*)", file.name) for file in files]
    numbers = {(part[1], part[3], int(part[2])) for part in parts if part}
    if len(numbers) < len(files) or len({number[:2] for number in numbers}) != 1:
        return []
    [(stem, suffix, _), *_] = numbers
    last = max(number for *_, number in numbers)
    if last >= 2 * len(files):  # these count something else, such as days
        return []
    return [f"{stem}{n}{suffix}" for n in range(last) if (stem, suffix, n) not in numbers]


def _mixed_types(topic: str, messages: int, type_name: str, chosen: str) -> str:
    """A note on skipped messages of another type than the ``chosen`` one of their topic."""
    difference = f"type {chosen}" if type_name != chosen else "a different type with the same name"
    noun = "message" if messages == 1 else "messages"
    return f"{topic}: {messages} {noun} of {type_name} skipped: the topic has {difference}"


def _distinct(texts: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(filter(None, texts)))
