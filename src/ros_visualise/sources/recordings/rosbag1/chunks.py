"""The chunks of a ROS 1 bag: what is in one, by its index or by walking through it."""

from __future__ import annotations

import io
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.records import Damaged, Fields, Op

ENTRY = np.dtype([("stamp_ns", "<i8"), ("connection", "<u4"), ("offset", "<u4")])
"""A message of a chunk: where in its content the record begins."""

_INDEXED = np.dtype([("sec", "<u4"), ("nanosec", "<u4"), ("offset", "<u4")])
_NS = 1_000_000_000
_KEPT_SIZE = 96 << 20  # chunks that overlap in time are read in turns: so much stays decompressed


class Chunk(NamedTuple):
    """A piece of the file with messages.

    ``counts`` are messages by connection. ``bare_end``: of records that lie in the file itself, not
    in a chunk, where they end; else 0.
    """

    position: int
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]
    bare_end: int = 0

    @property
    def messages(self) -> int:
        """How many are in it."""
        return sum(self.counts.values())


class Content(NamedTuple):
    """Where the records of a chunk stand: a file or memory, and from where to where in it."""

    file: BinaryIO
    start: int
    end: int
    memory: int = 0


@dataclass(frozen=True)
class Walk:
    """What walking through a chunk found, up to ``stop``."""

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
        self._opened: OrderedDict[int, Content] = OrderedDict()
        self._kept_size = 0

    def header(self, position: int) -> records.Record:
        """The chunk's own record.

        Raises:
            Damaged: there is no chunk.
        """
        record = records.read_record(self.file, position, self.size)
        if record.op != Op.CHUNK:
            raise Damaged("no chunk where one should be")
        return record

    def index(self, chunk_end: int) -> Iterator[tuple[int, NDArray[Any], int]]:
        """(Connection, its sec, nanosec and offset, end) of the index records behind a chunk.

        Ends where there are no more.
        """
        while True:
            try:
                record = records.read_record(self.file, chunk_end, self.size)
                if record.op != Op.INDEX:
                    return
                found = np.frombuffer(records.read_data(self.file, record), _INDEXED)
                connection = records.number(record.fields, b"conn")
            except (Damaged, ValueError):
                return
            if (found["nanosec"] >= _NS).any():
                return
            chunk_end = record.end
            yield connection, found, chunk_end

    def entries(self, chunk: Chunk) -> NDArray[Any]:
        """The messages of a chunk, by its index where that is whole, else by walking through it.

        None is before the chunk's own start.

        Raises:
            Damaged: there is no chunk, or its content cannot be read.
        """
        if not chunk.bare_end:
            indexed = [
                _entries(connection, found)
                for connection, found, _ in self.index(self.header(chunk.position).end)
            ]
            entries = np.concatenate(indexed) if indexed else np.empty(0, ENTRY)
            if count(entries["connection"]) == chunk.counts and _is_likely(entries, chunk):
                return entries
        walked = self.walk(self.content(chunk)).entries
        walked["stamp_ns"] = np.maximum(walked["stamp_ns"], chunk.start_ns)
        return walked

    def content(self, chunk: Chunk) -> Content:
        """What is in a chunk.

        Raises:
            Damaged: there is none, or it cannot be decompressed.
        """
        if chunk.position in self._opened:
            self._opened.move_to_end(chunk.position)
            return self._opened[chunk.position]
        content = self._opened[chunk.position] = self._open(chunk)
        self._kept_size += content.memory
        while self._kept_size > _KEPT_SIZE and len(self._opened) > 1:
            self.release(next(iter(self._opened)))
        return content

    def release(self, position: int) -> None:
        """Forget the content of the chunk there, if it is kept."""
        content = self._opened.pop(position, None)
        if content is not None:
            self._kept_size -= content.memory

    def walk(self, content: Content) -> Walk:
        """Look at every record of a chunk, up to the first that cannot be one."""
        file, position, end, _ = content
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
            except Damaged:
                break
            position = record.end
        return Walk(np.array(entries, ENTRY), connections, position)

    def message(self, content: Content, entry: tuple[int, int, int]) -> bytes:
        """The bytes of one message; its stamp may be another than that of its index.

        Raises:
            Damaged: there is one of another topic, or none.
        """
        _, connection, offset = entry
        file, start, end, _ = content
        file.seek(start + offset)
        header = file.read(records.MESSAGE_HEADER_SIZE)
        if records.is_message_header(header, connection):  # nearly always, and quick
            size = int.from_bytes(file.read(4), "little")
            if start + offset + len(header) + 4 + size > end:
                raise Damaged("a message that is longer than its chunk")
            return _exactly(file, size)
        record = records.read_record(file, start + offset, end)
        while record.op == Op.CONNECTION:  # some indexes point to the one before the message
            record = records.read_record(file, record.end, end)
        if (
            record.op != Op.MESSAGE
            or record.end > end
            or records.number(record.fields, b"conn") != connection
        ):
            raise Damaged("another message than the index says")
        return _exactly(file, record.data_size)

    def _open(self, chunk: Chunk) -> Content:
        if chunk.bare_end:
            return Content(self.file, chunk.position, chunk.bare_end)
        header = self.header(chunk.position)
        is_cut = header.end > self.size or not header.data_size  # 0: it was never finished
        end = self.size if is_cut else header.end
        compression = records.text(header.fields, b"compression")
        if compression == "none":
            return Content(self.file, header.data_position, end)
        self.file.seek(header.data_position)
        data = self.file.read(end - header.data_position)
        size = records.number(header.fields, b"size")
        found = records.decompress(compression, data, size, is_cut)
        return Content(io.BytesIO(found), 0, len(found), len(found))


def stamps_ns(indexed: NDArray[Any]) -> NDArray[np.int64]:
    """The times of an index record."""
    found: NDArray[np.int64] = indexed["sec"].astype(np.int64) * _NS + indexed["nanosec"]
    return found


def count(connections: NDArray[Any]) -> dict[int, int]:
    """How often each occurs."""
    found, counts = np.unique(connections, return_counts=True)
    return dict(zip(found.tolist(), counts.tolist(), strict=True))


def _exactly(file: BinaryIO, size: int) -> bytes:
    data = file.read(size)
    if len(data) != size:
        raise Damaged("the file has become shorter")
    return data


def _is_likely(entries: NDArray[Any], chunk: Chunk) -> bool:
    """Whether an index has each of its messages once, and in the chunk's time."""
    stamps, offsets = entries["stamp_ns"], entries["offset"]
    is_in_time = (stamps >= chunk.start_ns) & (stamps <= chunk.end_ns)
    return bool(is_in_time.all()) and len(np.unique(offsets)) == len(offsets)


def _entries(connection: int, indexed: NDArray[Any]) -> NDArray[Any]:
    entries = np.empty(len(indexed), ENTRY)
    entries["stamp_ns"] = stamps_ns(indexed)
    entries["connection"] = connection
    entries["offset"] = indexed["offset"]
    return entries
