"""One ROS 1 bag of version 2.0, read without ROS, also cut, damaged or never closed."""

from __future__ import annotations

import threading
from collections.abc import Collection, Iterator, Mapping
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import DamagedMessage, OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.messages.definitions import Definitions, Undecoded
from ros_visualise.sources.recordings import Extra, PartialLoss
from ros_visualise.sources.recordings.pieces import ChunkPiece, FileRange, PieceCache, Records
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import (
    ENTRY,
    Chunk,
    ChunkReader,
    Content,
    Entries,
    common_spans,
    count,
    gaps,
    locate,
)
from ros_visualise.sources.recordings.rosbag1.layout import (
    BagConnection,
    Layout,
    count_messages,
    read_layout,
)
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import Channel, MessageQuery, Piece
from ros_visualise.sources.recordings.unpacking import DamagedData

_EMPTY_MD5 = "d41d8cd98f00b204e9800998ecf8427e"  # of a type without fields
_EMPTY_TEXT = "# it has no fields"


class BagFile:
    """One ROS 1 bag; a `Storage`, whose pieces are chunks.

    Only the bag's index is read at first: the number of messages of each topic in each chunk, and
    its span of time. The places of messages in a chunk are read when their time comes. Raises
    OpenError.
    """

    def __init__(self, path: Path, schemas: Schemas, loss: PartialLoss) -> None:
        self._loss = loss
        self._noted: set[tuple[int, int]] = set()
        self._lock = threading.Lock()
        self._file = open_file(path)
        try:
            self.size = path.stat().st_size
            layout = _read_layout(path, self._file, self.size)
        except (OSError, OpenError):
            self._file.close()
            raise
        self.is_indexed = layout.indexed
        self._reader = ChunkReader(self._file, self.size)
        self._chunks = [chunk for chunk in layout.chunks if chunk.counts]
        positions = [chunk.position for chunk in layout.chunks]
        following = [*positions[1:], layout.index_position]
        self._following = dict(zip(positions, following, strict=True)) if positions else {}
        self.channels: Mapping[int, Channel] = describe(layout.connections, schemas)
        self.counts: Mapping[int, int] = count_messages(self._chunks)
        self.starts_ns = np.array([chunk.start_ns for chunk in self._chunks], np.int64)
        self.ends_ns = np.array([chunk.end_ns for chunk in self._chunks], np.int64)
        nameless = sum(n for number, n in self.counts.items() if number not in self.channels)
        if nameless:
            layout.loss.add(f"{nameless} messages on topics without a description", nameless)
        loss.absorb(layout.loss)

    @cached_property
    def compressions(self) -> Collection[str]:
        """Compressions of all chunks."""
        with self._lock:
            found = {self._compression(chunk) for chunk in self._chunks if not self._file.closed}
        return found - {""} or {"none"}

    def select(self, query: MessageQuery) -> npt.NDArray[np.intp]:
        wanted = query.readable(self.channels).keys()
        is_asked = np.array([not wanted.isdisjoint(c.counts) for c in self._chunks], bool)
        return np.flatnonzero(is_asked & query.is_within(self.starts_ns, self.ends_ns))

    def open_piece(self, piece: int, query: MessageQuery, cache: PieceCache) -> Piece:
        chunk = self._chunks[piece]
        wanted = query.readable(self.channels)
        with self._lock:
            content = self._content(chunk)
            if content is None:
                return ChunkPiece((), wanted, b"", lambda: None, cache)
            entries = self._entries(chunk, content)
            spans = common_spans(content, entries)
            if self._is_short(content, entries, spans):
                self._lose(chunk, 0, -2, "messages missing from its index")
                entries = self._reader.walked(chunk, content)
                spans = common_spans(content, entries)
            stamps_ns = entries["stamp_ns"]
            if ((spans[2] >= 0) & (spans[2] != stamps_ns)).any():
                self._lose(chunk, 0, -4, "stamps in its index and messages differ")
            is_asked = np.isin(entries["connection"], list(wanted))
            is_asked &= (stamps_ns >= query.start_ns) & (stamps_ns < query.stop_ns)
            entries, spans = entries[is_asked], spans[:, is_asked]
            order = np.lexsort((entries["offset"], entries["stamp_ns"]))
            places = locate(content, entries[order], spans[:, order], partial(self._lose, chunk, 1))
        load = partial(self._load, chunk)
        return ChunkPiece(places, wanted, self._records(content), load, cache)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        for chunk in self._chunks:
            with self._lock:
                entries = self._entries(chunk)
            for number in count(entries["connection"]):
                yield number, entries["stamp_ns"][entries["connection"] == number]

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        with self._lock:
            self._file.close()

    def _content(self, chunk: Chunk) -> Content | None:
        """None if it is damaged, or the file is closed."""
        if self._file.closed:
            return None
        try:
            return self._reader.content(chunk)
        except (DamagedData, OSError) as error:
            self._lose(chunk, chunk.messages, -1, str(error))
            return None

    def _entries(self, chunk: Chunk, content: Content | None = None) -> npt.NDArray[Any]:
        """Places of the messages of a chunk, as `ENTRY`."""
        if self._file.closed:
            return np.empty(0, ENTRY)
        try:
            entries = self._reader.entries(chunk, content)
        except (DamagedData, OSError) as error:
            self._lose(chunk, chunk.messages, -1, str(error))
            return np.empty(0, ENTRY)
        self._compare(chunk, entries)
        return entries.found

    def _compare(self, chunk: Chunk, entries: Entries) -> None:
        """Compare a chunk and the index behind it with the index at the bag's end."""
        if missing := max(0, chunk.messages - len(entries.found)):
            self._lose(chunk, missing, -1, "a part of a chunk is damaged")
        elif self.is_indexed and not entries.agrees:
            self._lose(chunk, 0, -1, "the chunk, its index and the index of the bag disagree")
        elif self.is_indexed and entries.end != self._following[chunk.position]:
            hidden = self._following[chunk.position] - entries.end
            self._lose(chunk, 0, -3, f"{hidden} bytes after it are missing from the bag's index")

    def _is_short(
        self, content: Content, entries: npt.NDArray[Any], spans: npt.NDArray[np.int64]
    ) -> bool:
        """True if a chunk holds messages that its index does not name."""
        for start, end in gaps(content, entries, spans):
            walk = self._reader.walk(content._replace(start=start, end=end))
            if len(walk.entries):
                return True
        return False

    def _load(self, chunk: Chunk) -> Records | FileRange | None:
        with self._lock:
            content = self._content(chunk)
        return None if content is None else self._records(content)

    def _records(self, content: Content) -> Records | FileRange:
        if content.data is None:
            return FileRange(self._read, content.start, content.end)
        return content.data

    def _read(self, start: int, size: int) -> bytes:
        """A part of the file; nothing once it is closed."""
        with self._lock:
            if self._file.closed:
                return b""
            self._file.seek(start)
            return self._file.read(size)

    def _compression(self, chunk: Chunk) -> str:
        """Compression of a chunk; empty if it is damaged."""
        try:
            fields = {} if chunk.bare_end else self._reader.header(chunk.position).fields
        except (DamagedData, OSError):
            return ""
        return records.text(fields, b"compression") or "none"

    def _lose(self, chunk: Chunk, messages: int, offset: int, why: str) -> None:
        """Note once what is lost: messages of a chunk, or the one at an offset in it."""
        if (chunk.position, offset) in self._noted:
            return
        self._noted.add((chunk.position, offset))
        lost = f"; messages lost: {messages}" if messages else ""
        self._loss.add(f"at {chunk.position / 1e6:.1f} MB: {why}{lost}", messages)


def _read_layout(path: Path, file: BinaryIO, size: int) -> Layout:
    magic = file.read(len(records.MAGIC))
    if magic != records.MAGIC:
        if magic.startswith(b"#ROSBAG V") and len(magic) == len(records.MAGIC):
            raise OpenError(
                f"{path}: unsupported bag version; with ROS: rosbag filter {path} NEW.bag True"
            )
        raise OpenError(f"{path}: not a ROS 1 bag, or cut off; copy or record it again")
    layout = read_layout(file, size)
    if layout.encryptor:
        raise OpenError(f"{path}: encrypted; decrypt it first, with ROS: rosbag decrypt {path}")
    return layout


def describe(connections: Mapping[int, BagConnection], schemas: Schemas) -> dict[int, Channel]:
    """The connections of a bag as their messages are to be read."""

    @cache
    def define(type_name: str, digest: str, text: str) -> tuple[Definitions, str]:
        return _define(schemas, type_name, digest, text)

    found = {}
    for number, one in connections.items():
        definitions, unreadable = define(one.type_name, one.digest, one.definition)
        found[number] = Channel(
            one.topic,
            one.type_name,
            definitions,
            one.digest,
            one.latched,
            unreadable,
            callerid=one.callerid,
        )
    return found


def _define(schemas: Schemas, type_name: str, digest: str, text: str) -> tuple[Definitions, str]:
    """Definitions of a type, and why its messages cannot be read; empty: they can."""
    if not text.strip() and digest == _EMPTY_MD5:
        text = _EMPTY_TEXT
    try:
        found = schemas.define("ros1", type_name, text)
        problem = f"{type_name}: not defined in the bag, and no built-in ROS type matches it"
    except DamagedMessage as error:
        found = Definitions("ros1")
        problem = str(error)
    else:
        if text.strip():
            return found, ""
    if found.knows(type_name) and found.digest(type_name) == digest:
        return found, ""  # as ROS itself defines it
    return Undecoded("ros1", text, digest, problem), problem
