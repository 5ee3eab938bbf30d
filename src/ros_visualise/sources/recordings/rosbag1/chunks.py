"""The chunks of a ROS 1 bag and their messages, by the index or by reading through them."""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ros_visualise.sources.recordings.pieces import Place
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.records import Fields, Op
from ros_visualise.sources.recordings.unpacking import DamagedData

ENTRY = np.dtype([("stamp_ns", "<i8"), ("connection", "<u4"), ("offset", "<u4")])
"""A message of a chunk, and the beginning of its record in the content."""

_INDEXED = np.dtype([("sec", "<u4"), ("nanosec", "<u4"), ("offset", "<u4")])
_NS = 1_000_000_000
_LOADED_BYTES = 32 << 20  # of a chunk that is not compressed; a larger one is read bit by bit
_LARGE_BYTES = 4096  # of a message: reading each by itself then costs little
_LENGTH = b"\x26\0\0\0"
_FIELDS = (b"\x09\0\0\0conn=????", b"\x04\0\0\0op=\x02", b"\x0d\0\0\0time=????????")
_HEADS = [
    np.frombuffer(_LENGTH + b"".join(order), np.uint8) for order in itertools.permutations(_FIELDS)
]
"""A message's header with its fields in any order, as writers differ; its values are ``?``."""
_HEAD_BYTES = 42
_SIZED_HEAD = np.arange(_HEAD_BYTES + 4)


class Chunk(NamedTuple):
    """A piece of the file with messages.

    ``counts`` are messages by connection. ``bare_end``: end of records that lie in the file itself,
    not in a chunk; else 0.
    """

    position: int
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]
    bare_end: int = 0

    @property
    def messages(self) -> int:
        """Number of its messages."""
        return sum(self.counts.values())


class Content(NamedTuple):
    """The records of a chunk: a range of a file, or of memory.

    ``data``: all of them, if they are in memory. ``origin``: their beginning in the bag itself; -1
    if they were compressed.
    """

    file: BinaryIO
    start: int
    end: int
    data: bytes | None
    origin: int


class Entries(NamedTuple):
    """The messages of a chunk, as `ENTRY`.

    ``end``: end of the index records behind the chunk. ``agrees``: these are whole, and match the
    index at the bag's end.
    """

    found: NDArray[Any]
    end: int
    agrees: bool


@dataclass(frozen=True)
class Walk:
    """Content of a chunk that was read through, up to ``stop``."""

    entries: NDArray[Any]
    connections: list[tuple[Fields, bytes]]
    stop: int

    def chunk(self, position: int, bare_end: int = 0) -> Chunk:
        """The chunk with those messages."""
        stamps, counts = self.entries["stamp_ns"], count(self.entries["connection"])
        if not len(stamps):
            return Chunk(position, 0, 0, {}, bare_end)
        return Chunk(position, int(stamps.min()), int(stamps.max()), counts, bare_end)


class ChunkReader:
    """Reads chunks of an open file of ``size`` bytes; for one thread."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self.file = file
        self.size = size

    def header(self, position: int) -> records.BagRecord:
        """The chunk's own record; raises DamagedData if it is none."""
        record = records.read_record(self.file, position, self.size)
        if record.op != Op.CHUNK:
            raise DamagedData("expected a chunk")
        return record

    def index(self, chunk_end: int) -> Iterator[tuple[int, NDArray[Any], int]]:
        """(Connection, its sec, nanosec and offset, end) of the index records behind a chunk."""
        while True:
            try:
                record = records.read_record(self.file, chunk_end, self.size)
                if record.op != Op.INDEX:
                    return
                found = np.frombuffer(records.read_data(self.file, record), _INDEXED)
                connection = records.number(record.fields, b"conn")
            except (DamagedData, ValueError):
                return
            if (found["nanosec"] >= _NS).any():
                return
            chunk_end = record.end
            yield connection, found, chunk_end

    def entries(self, chunk: Chunk, content: Content | None = None) -> Entries:
        """The messages of a chunk, by its index if that is whole, else by reading through it.

        ``content``: the chunk's, if it was read already.

        Raises:
            DamagedData: it is no chunk, or its content cannot be read.
        """
        end = 0
        if not chunk.bare_end:
            end, indexed = self.header(chunk.position).end, [np.empty(0, ENTRY)]
            for connection, found, following in self.index(end):
                indexed.append(_entries(connection, found))
                end = following
            entries = np.concatenate(indexed)
            if count(entries["connection"]) == chunk.counts and _is_likely(entries, chunk):
                stamps = entries["stamp_ns"]
                span_ns = stamps.min(initial=chunk.end_ns), stamps.max(initial=chunk.start_ns)
                return Entries(entries, end, span_ns == (chunk.start_ns, chunk.end_ns))
        return Entries(self.walked(chunk, content or self.content(chunk)), end, False)

    def walked(self, chunk: Chunk, content: Content) -> NDArray[Any]:
        """The messages of a chunk by reading through it; none is before the chunk's own start."""
        entries = self.walk(content).entries
        entries["stamp_ns"] = np.maximum(entries["stamp_ns"], chunk.start_ns)
        return entries

    def content(self, chunk: Chunk) -> Content:
        """The content of a chunk; raises DamagedData if it is none, or cannot be decompressed."""
        if chunk.bare_end:
            return self._stored(chunk, chunk.position, chunk.bare_end)
        header = self.header(chunk.position)
        is_cut = header.end > self.size or not header.data_size  # 0: it was never finished
        end = self.size if is_cut else header.end
        compression = records.text(header.fields, b"compression")
        if compression == "none":
            return self._stored(chunk, header.data_position, end)
        self.file.seek(header.data_position)
        data = self.file.read(end - header.data_position)
        size = records.number(header.fields, b"size")
        found = records.decompress(compression, data, size, is_cut)
        return Content(io.BytesIO(found), 0, len(found), found, -1)

    def walk(self, content: Content) -> Walk:
        """Read every record of a chunk, up to the first damaged one."""
        file, position, end = content[:3]
        entries: list[tuple[int, int, int]] = []
        connections: list[tuple[Fields, bytes]] = []
        while position < end:
            try:
                record = records.read_record(file, position, end)
                if record.end > end:
                    break
                if record.op == Op.CONNECTION:
                    connections.append((record.fields, records.read_data(file, record)))
                elif record.op == Op.MESSAGE:
                    stamp_ns = records.time_ns(record.fields, b"time")
                    connection = records.number(record.fields, b"conn")
                    entries.append((stamp_ns, connection, position - content.start))
                else:
                    break
            except DamagedData:
                break
            position = record.end
        return Walk(np.array(entries, ENTRY), connections, position)

    def _stored(self, chunk: Chunk, start: int, end: int) -> Content:
        """Records that are not compressed; in memory if they are small and many."""
        if end - start > min(_LOADED_BYTES, _LARGE_BYTES * chunk.messages):
            return Content(self.file, start, end, None, start)
        self.file.seek(start)
        data = self.file.read(end - start)
        return Content(io.BytesIO(data), 0, len(data), data, start)


def stamps_ns(indexed: NDArray[Any]) -> NDArray[np.int64]:
    """The times of an index record."""
    found: NDArray[np.int64] = indexed["sec"].astype(np.int64) * _NS + indexed["nanosec"]
    return found


def count(connections: NDArray[Any]) -> dict[int, int]:
    """Number of occurrences of each."""
    found, counts = np.unique(connections, return_counts=True)
    return dict(zip(found.tolist(), counts.tolist(), strict=True))


def _is_likely(entries: NDArray[Any], chunk: Chunk) -> bool:
    """True if an index has each of its messages once, and in the chunk's time."""
    stamps, offsets = entries["stamp_ns"], entries["offset"]
    is_in_time = (stamps >= chunk.start_ns) & (stamps <= chunk.end_ns)
    return bool(is_in_time.all()) and len(np.unique(offsets)) == len(offsets)


def _entries(connection: int, indexed: NDArray[Any]) -> NDArray[Any]:
    entries = np.empty(len(indexed), ENTRY)
    entries["stamp_ns"] = stamps_ns(indexed)
    entries["connection"] = connection
    entries["offset"] = indexed["offset"]
    return entries


def locate(
    content: Content,
    entries: NDArray[Any],
    spans: NDArray[np.int64],
    lose: Callable[[int, str], None],
) -> list[Place]:
    """The places of messages, in their order; without those that the index misplaces.

    Args:
        entries: (N,) of `ENTRY`.
        spans: (3, N) theirs, as `common_spans` gives them.
        lose: called with the offset of each misplaced one, and why.
    """
    starts, sizes, _ = spans
    for i in np.flatnonzero(starts < 0):
        _, connection, offset = entries[i].tolist()
        try:
            starts[i], sizes[i] = _any(content, connection, offset)
        except DamagedData as damage:
            lose(offset, str(damage))
    there = starts >= 0
    stamps_ns, starts = entries["stamp_ns"][there].tolist(), starts[there]
    stops = (starts + sizes[there]).tolist()
    numbers = entries["connection"][there].tolist()
    return list(
        zip(
            stamps_ns, numbers, starts.tolist(), stops, stamps_ns, itertools.repeat(0), strict=False
        )
    )


def gaps(
    content: Content, entries: NDArray[Any], spans: NDArray[np.int64]
) -> Iterator[tuple[int, int]]:
    """Ranges of a chunk in memory without any message that its index names."""
    known = spans[0] >= 0
    order = np.argsort(entries["offset"][known])
    begins = entries["offset"][known][order].astype(np.int64)
    ends = spans[:2].sum(axis=0)[known][order]
    if content.data is None or not known.all():
        return
    lefts, rights = np.append(0, ends), np.append(begins, len(content.data))
    for place in np.flatnonzero(lefts < rights):
        yield int(lefts[place]), int(rights[place])


def common_spans(content: Content, entries: NDArray[Any]) -> NDArray[np.int64]:
    """(3, N) starts, sizes and stamps of messages whose header has just its three fields; else -1.

    The stamps are the messages' own, in nanoseconds.
    """
    starts, sizes, stamps_ns = np.full((3, len(entries)), -1, np.int64)
    data = np.frombuffer(content.data or b"", np.uint8)
    offsets = entries["offset"].astype(np.int64)
    for head in _HEADS:
        [left] = np.nonzero((starts < 0) & (offsets <= len(data) - len(_SIZED_HEAD)))
        if not len(left):
            break
        found = data[offsets[left, None] + _SIZED_HEAD]
        connection = bytes(head).index(b"conn=") + len(b"conn=")
        fixed = np.flatnonzero(head != ord("?"))
        is_one = (found[:, fixed] == head[fixed]).all(axis=1)
        is_one &= _numbers(found, connection) == entries["connection"][left]
        found_starts, found_sizes = offsets[left] + len(_SIZED_HEAD), _numbers(found, _HEAD_BYTES)
        is_one &= found_starts + found_sizes <= len(data)
        starts[left[is_one]], sizes[left[is_one]] = found_starts[is_one], found_sizes[is_one]
        time = bytes(head).index(b"time=") + len(b"time=")
        found_ns = _numbers(found, time) * 1_000_000_000 + _numbers(found, time + 4)
        stamps_ns[left[is_one]] = found_ns[is_one]
    return np.stack([starts, sizes, stamps_ns])


def _numbers(heads: NDArray[np.uint8], at: int) -> NDArray[np.int64]:
    found: NDArray[np.uint32] = np.ascontiguousarray(heads[:, at : at + 4]).view("<u4")[:, 0]
    return found.astype(np.int64)


def _any(content: Content, connection: int, offset: int) -> tuple[int, int]:
    """Start and size of one message, whatever its header is like; raises DamagedData."""
    file, start, end = content[:3]
    record = records.read_record(file, start + offset, end)
    while record.op == Op.CONNECTION:  # some indexes point to the one before the message
        record = records.read_record(file, record.end, end)
    if record.op != Op.MESSAGE or records.number(record.fields, b"conn") != connection:
        raise DamagedData("not the indexed message")
    if record.end > end:
        raise DamagedData("a message that is longer than its chunk")
    return record.data_position - start, record.data_size
