"""The index of an MCAP file's messages: a row per chunk, or per run of messages outside.

The mcap library's ``get_summary()`` does not look at the summary's checksum, and takes three times
as long where there are many chunks.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from ros_visualise.sources.recordings.mcap_records import (
    CHUNK_HEAD_BYTES,
    COMPRESSIONS,
    HEAD,
    HEAD_BYTES,
    MAGIC,
    chunk_head,
    describing,
    parse,
)
from ros_visualise.sources.recordings.unpacking import DamagedData

UNKNOWN = -1
"""Count of messages, or set of channels, of a piece without an index."""

_MESSAGE_INDEX_HEAD = struct.Struct("<HI")
_ENTRY_BYTES = 16
_MESSAGE_INDEX_BYTES = HEAD_BYTES + _MESSAGE_INDEX_HEAD.size
_STAMP_LIMIT = 2**63 - 1
_ROW = np.dtype(
    [
        ("offset", "<i8"),
        ("length", "<i8"),
        ("start_ns", "<i8"),
        ("end_ns", "<i8"),
        ("messages", "<i8"),
        ("channels", "<i4"),
        ("is_chunk", "<i4"),
    ]
)
_PACK_ROW = struct.Struct("<5q2i")
_FOOTER = struct.Struct("<BQQQI8s")
_FOOTER_LENGTH = 20
_CHUNK_INDEX = struct.Struct("<QQQQI")
_CHUNK_INDEX_TAIL = struct.Struct("<QI")
_OFFSET_OF_CHANNEL = struct.Struct("<HQ")
_DATA_END = struct.Struct("<BQI")
_EXTRA_INDEX = struct.Struct("<QQ")


@dataclass
class Index:
    """The pieces of a file, and its channels.

    ``extras``: places and lengths of its attachments and records of metadata. ``ends``: end of the
    index records behind each of its chunks, as far as the file declares it.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    compressions: set[str] = field(default_factory=set)
    channel_sets: list[frozenset[int]] = field(default_factory=list)
    extras: list[tuple[int, int]] = field(default_factory=list)
    ends: list[int] = field(default_factory=list)
    _rows: bytearray = field(default_factory=bytearray)
    _set_numbers: dict[frozenset[int], int] = field(default_factory=dict)

    def add(
        self,
        offset: int,
        length: int,
        span_ns: tuple[int, int],
        messages: int = UNKNOWN,
        channels: Collection[int] | None = None,
        is_chunk: bool = True,
    ) -> None:
        """Add a piece: its place in the file, and its content as far as that is known."""
        start_ns = min(span_ns[0], _STAMP_LIMIT)
        end_ns = min(span_ns[1], _STAMP_LIMIT)
        number = UNKNOWN if channels is None else self._number(frozenset(channels))
        self._rows += _PACK_ROW.pack(offset, length, start_ns, end_ns, messages, number, is_chunk)

    def count(self, messages: Mapping[int, int]) -> None:
        """Add to the messages of channels."""
        for channel, count in messages.items():
            self.counts[channel] = self.counts.get(channel, 0) + count

    def describe(self, found: Iterable[Schema | Channel]) -> None:
        """Add schemas and channels; the first of a number counts."""
        for one in found:
            if isinstance(one, Schema):
                self.schemas.setdefault(one.id, one)
            else:
                self.channels.setdefault(one.id, one)

    @property
    def rows(self) -> npt.NDArray[np.void]:
        """The pieces: offset, length, start_ns, end_ns, messages, channels, is_chunk."""
        return np.frombuffer(bytes(self._rows), _ROW)

    @property
    def is_described(self) -> bool:
        """True if it knows all channels that its pieces name, and their schemas."""
        return all(map(self.knows, self.channel_sets))

    def knows(self, channels: Iterable[int]) -> bool:
        """True if it knows these channels, and their schemas."""
        found = [self.channels.get(channel) for channel in channels]
        return all(one and (not one.schema_id or one.schema_id in self.schemas) for one in found)

    def _number(self, channels: frozenset[int]) -> int:
        if channels not in self._set_numbers:
            self._set_numbers[channels] = len(self.channel_sets)
            self.channel_sets.append(channels)
        return self._set_numbers[channels]


def read_index(file: BinaryIO, size: int) -> Index | None:
    """The index at the file's end; None if it is missing, or not of all messages.

    Source: the MCAP format specification, "Summary Section".

    Raises:
        DamagedData: it does not match the file; says why.
    """
    summary = _read_summary(file, size)
    if summary is None:
        return None
    try:
        index, statistics, chunks = _parse_summary(summary)
    except struct.error:
        raise DamagedData("a record of the index is too short") from None
    if statistics is None or not chunks or not index.is_described:
        return None
    index.counts = dict(statistics.channel_message_counts)
    _check(file, size, index, statistics, chunks)
    known = index.rows["messages"]
    is_all = (
        statistics.message_count == sum(index.counts.values())
        and (UNKNOWN in known or int(known.sum()) == statistics.message_count)
        and statistics.attachment_count + statistics.metadata_count == len(index.extras)
        and not _hides(file, size, index)
    )
    return index if is_all else None


def _check(file: BinaryIO, size: int, index: Index, statistics: Statistics, chunks: int) -> None:
    """Check an index against itself and, at its ends, against the file."""
    rows = index.rows
    if statistics.chunk_count != chunks:
        raise DamagedData(
            f"the statistics count {statistics.chunk_count} chunks, but the index lists {chunks}"
        )
    if index.counts and statistics.message_count != sum(index.counts.values()):
        raise DamagedData("the message counts are inconsistent")
    is_within = (rows["offset"] > 0) & (rows["offset"] <= size - rows["length"])
    if not is_within.all() or not index.counts.keys() <= index.channels.keys():
        raise DamagedData("the index points outside the file")
    if not all(_is_there(file, rows[i]) for i in {0, chunks - 1}):
        raise DamagedData("chunks are not where the index says")
    if not all(_is_extra(file, min(offset, size), n) for offset, n in index.extras):
        raise DamagedData("attachments are not where the index says")


def _hides(file: BinaryIO, size: int, index: Index) -> bool:
    """True if there are messages between the chunks that an index names; raises DamagedData."""
    order = np.argsort(index.rows["offset"])
    starts = [*index.rows["offset"][order].tolist(), None]
    position = len(MAGIC)
    for start, end in zip(starts, [*(index.ends[i] for i in order), 0], strict=True):
        while position != start:
            file.seek(min(position, size))
            head = file.read(HEAD_BYTES)
            kind, length = HEAD.unpack(head) if len(head) == HEAD_BYTES else (0, 0)
            if start is None and kind == Opcode.DATA_END:
                return False
            if kind == Opcode.MESSAGE:
                return True
            if kind in (0, Opcode.CHUNK, Opcode.MESSAGE_INDEX) or position > (start or position):
                raise DamagedData("the file contains records that the index does not list")
            position += HEAD_BYTES + length
        position = end
    return False


def index_bytes(channels: int, messages: int) -> int:
    """The size of the index records behind a chunk, one for each of its channels."""
    return _MESSAGE_INDEX_BYTES * channels + _ENTRY_BYTES * messages


def indexed_stamps(records: bytes) -> list[tuple[int, npt.NDArray[np.int64]]]:
    """Channels and their stamps in the index records behind a chunk; none if they are damaged."""
    found = []
    position = 0
    while position + _MESSAGE_INDEX_BYTES <= len(records):
        kind, length = HEAD.unpack_from(records, position)
        channel, size = _MESSAGE_INDEX_HEAD.unpack_from(records, position + HEAD_BYTES)
        position += _MESSAGE_INDEX_BYTES
        is_index = kind == Opcode.MESSAGE_INDEX and length == size + _MESSAGE_INDEX_HEAD.size
        if not is_index or size % _ENTRY_BYTES or position + size > len(records):
            return []
        pairs = np.frombuffer(records[position : position + size], "<u8").reshape(-1, 2)
        found.append((channel, pairs[:, 0].astype(np.int64)))
        position += size
    return found


def _read_summary(file: BinaryIO, size: int) -> bytes | None:
    end = size - _FOOTER.size
    if end < len(MAGIC) + _DATA_END.size:
        return None
    file.seek(end)
    footer = file.read(_FOOTER.size)
    kind, length, start, _, crc, magic = _FOOTER.unpack(footer)
    if (kind, length, magic) != (Opcode.FOOTER, _FOOTER_LENGTH, MAGIC) or not start:
        return None
    file.seek(max(0, min(start, end) - _DATA_END.size))
    if start >= end or _DATA_END.unpack(file.read(_DATA_END.size))[:2] != (Opcode.DATA_END, 4):
        raise DamagedData("the index is not where the file says")
    summary = file.read(end - start)
    checked = footer[: HEAD_BYTES + 16]  # the checksum covers the footer up to itself
    if crc and zlib.crc32(checked, zlib.crc32(summary)) != crc:
        raise DamagedData("checksum mismatch")
    return summary


def _parse_summary(summary: bytes) -> tuple[Index, Statistics | None, int]:
    index, statistics, chunks = Index(), None, 0
    position = 0
    while position < len(summary):
        kind, length = HEAD.unpack_from(summary, position)
        position += HEAD_BYTES
        body = summary[position : position + length]
        position += length
        if kind == Opcode.CHUNK_INDEX:
            _add_chunk(index, body)
            chunks += 1
        elif one := describing(kind, body):
            index.describe([one])
        elif kind in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
            index.extras.append(_EXTRA_INDEX.unpack_from(body))
        elif kind == Opcode.STATISTICS:
            statistics = read_statistics(body)
    if position != len(summary):
        raise DamagedData("the summary ends within a record")
    index.extras.sort()
    return index, statistics, chunks


def _add_chunk(index: Index, body: bytes) -> None:
    start_ns, end_ns, offset, length, map_length = _CHUNK_INDEX.unpack_from(body)
    position = _CHUNK_INDEX.size
    pairs = body[position : position + map_length]
    channels = [channel for channel, _ in _OFFSET_OF_CHANNEL.iter_unpack(pairs)]
    index_length, letters = _CHUNK_INDEX_TAIL.unpack_from(body, position + map_length)
    position += map_length + _CHUNK_INDEX_TAIL.size
    compression = body[position : position + letters].decode("ascii", "replace")
    index.compressions.add(COMPRESSIONS.get(compression, compression))
    index.ends.append(offset + length + index_length)
    if not channels:
        index.add(offset, length, (start_ns, end_ns))
    else:
        messages, rest = divmod(index_length - index_bytes(len(channels), 0), _ENTRY_BYTES)
        known = UNKNOWN if rest or messages < 0 else messages
        index.add(offset, length, (start_ns, end_ns), known, channels)


def read_statistics(body: bytes) -> Statistics | None:
    """The counts of a file, or None if they are damaged."""
    with suppress(DamagedData):
        return parse(Statistics, body)
    return None


def _is_there(file: BinaryIO, row: np.void) -> bool:
    """True if a chunk is at the place in its row."""
    file.seek(int(row["offset"]))
    head = file.read(CHUNK_HEAD_BYTES)
    try:
        chunk_head(head)
    except DamagedData:
        return False
    return bool(HEAD.unpack_from(head)[1] + HEAD_BYTES == row["length"])


def _is_extra(file: BinaryIO, offset: int, length: int) -> bool:
    """True if an attachment or metadata is at a place."""
    file.seek(offset)
    head = file.read(HEAD_BYTES)
    if len(head) < HEAD_BYTES or head[0] not in (Opcode.ATTACHMENT, Opcode.METADATA):
        return False
    return bool(HEAD.unpack(head)[1] + HEAD_BYTES == length)
