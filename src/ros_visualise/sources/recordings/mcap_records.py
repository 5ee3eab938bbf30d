"""The records of MCAP files, as far as their messages need them.

Source: the MCAP format specification, mcap.dev/spec, version 0.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Container, Iterator
from contextlib import suppress
from operator import itemgetter
from typing import NamedTuple, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from ros_visualise.sources.recordings import Extra
from ros_visualise.sources.recordings.pieces import Place, Records
from ros_visualise.sources.recordings.unpacking import DamagedData, unpack_chunk

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
"""Beginning of each record: its kind and the length of the rest."""

HEAD_BYTES = HEAD.size
CHUNK_HEAD_BYTES = 64
"""Enough of a chunk's start for `chunk_head`."""

EVER = (0, 2**64)
"""The stamps that a file can hold."""

ANY_CHANNEL = range(2**16)

COMPRESSIONS = {"": "none", "lz4": "lz4", "zstd": "zstd"}

_MESSAGE = struct.Struct("<BQHIQQ")
_CHUNK = struct.Struct("<QQQII")
_DATA_LENGTH = struct.Struct("<Q")
_CRC_BYTES = 4

R = TypeVar("R")


class ChunkHead(NamedTuple):
    """A chunk's start; its compressed records begin ``data_offset`` after its record does.

    ``end``: end of the chunk itself, after its record's beginning.
    """

    start_ns: int
    end_ns: int
    uncompressed_size: int
    crc: int
    compression: str
    data_offset: int
    end: int


def chunk_head(record: bytes) -> ChunkHead:
    """The start of a chunk, of its first `CHUNK_HEAD_BYTES` bytes; raises DamagedData."""
    try:
        kind, length = HEAD.unpack_from(record)
        start_ns, end_ns, size, crc, letters = _CHUNK.unpack_from(record, HEAD_BYTES)
        after = HEAD_BYTES + _CHUNK.size + letters
        (data_length,) = _DATA_LENGTH.unpack_from(record, after)
    except struct.error:
        raise DamagedData("its header is damaged") from None
    compression = record[after - letters : after].decode("ascii", "replace")
    data_offset = after + _DATA_LENGTH.size
    if kind != Opcode.CHUNK or data_offset - HEAD_BYTES + data_length != length:
        raise DamagedData("its header is damaged")
    return ChunkHead(start_ns, end_ns, size, crc, compression, data_offset, HEAD_BYTES + length)


def decompress(record: bytes, check: bool = True) -> Records:
    """The records in a chunk that may be cut off; raises DamagedData, also by its checksum."""
    head = chunk_head(record)
    if head.compression not in COMPRESSIONS:
        raise DamagedData(
            f"unsupported compression {head.compression}; only lz4 and zstd can be read"
        )
    packed = memoryview(record)[head.data_offset :]
    is_cut = len(record) < head.end
    data: Records = packed
    if head.compression:
        data = unpack_chunk(head.compression, packed, head.uncompressed_size, is_cut)
    if is_cut:
        return _whole_records(data)
    is_changed = check and head.crc and zlib.crc32(data) != head.crc
    if len(data) != head.uncompressed_size or is_changed:
        raise DamagedData("checksum mismatch")
    return data


def messages(
    records: Records, channels: Container[int], start_ns: int, stop_ns: int
) -> tuple[list[Place], bool]:
    """The messages of some channels from a stamp until before another, in order of time.

    Returns:
        They, and whether the records could be read to their end.
    """
    found: list[Place] = []
    position, end = 0, len(records)
    last, is_sorted = -1, True
    unpack, message_bytes, kind_message = _MESSAGE.unpack_from, _MESSAGE.size, int(Opcode.MESSAGE)
    while position + message_bytes <= end:
        kind, length, channel, sequence, log_time, publish_time = unpack(records, position)
        after = position + HEAD_BYTES + length
        if kind == kind_message and start_ns <= log_time < stop_ns and channel in channels:
            if after > end or length < message_bytes - HEAD_BYTES:
                break
            start = position + message_bytes
            found.append((log_time, channel, start, after, publish_time, sequence))
            is_sorted = is_sorted and log_time >= last
            last = log_time
        position = after
    if not is_sorted:
        found.sort(key=itemgetter(0))
    return found, position == end or _is_short_tail(records, position)


def described(records: Records) -> Iterator[Schema | Channel]:
    """The schemas and channels among records, as far as they can be read."""
    position = 0
    while position + HEAD_BYTES <= len(records):
        kind, length = HEAD.unpack_from(records, position)
        body = slice(position + HEAD_BYTES, position + HEAD_BYTES + length)
        position = body.stop
        if found := describing(kind, records[body]):
            yield found


def describing(kind: int, body: Records) -> Schema | Channel | None:
    """The schema or channel of a record; None if it is of another kind, or damaged."""
    types = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}
    with suppress(DamagedData):
        return parse(types[Opcode(kind)], body) if kind in types else None
    return None


def parse(kind: type[R], body: Records) -> R:
    """A record by mcap's own parser; raises DamagedData."""
    try:
        found: R = kind.read(ReadDataStream(io.BytesIO(body)))  # type: ignore[attr-defined]
    except (McapError, struct.error, UnicodeDecodeError, OverflowError):
        raise DamagedData("the record is inconsistent") from None
    return found


def _is_short_tail(records: Records, position: int) -> bool:
    """True if whole records, too short to be messages, end a piece."""
    while position + HEAD_BYTES <= len(records):
        position += HEAD_BYTES + HEAD.unpack_from(records, position)[1]
    return position == len(records)


def _whole_records(records: Records) -> Records:
    """All records but the last one, if that is cut."""
    position = following = 0
    while following <= len(records):
        position = following
        if position + HEAD_BYTES > len(records):
            break
        following += HEAD_BYTES + HEAD.unpack_from(records, position)[1]
    return records[:position]


def parse_extra(record: bytes) -> Extra:
    """An attachment or a record of metadata, of all its bytes.

    Source: the MCAP format specification, "Attachment" and "Metadata".

    Raises:
        DamagedData: it is neither, or its checksum is wrong.
    """
    if len(record) < HEAD_BYTES or HEAD.unpack_from(record)[1] != len(record) - HEAD_BYTES:
        raise DamagedData("its length is damaged")
    body = record[HEAD_BYTES:]
    if record[0] == Opcode.METADATA:
        return parse(Metadata, body)
    if record[0] != Opcode.ATTACHMENT:
        raise DamagedData("neither an attachment nor metadata")
    crc = int.from_bytes(body[-_CRC_BYTES:], "little")
    if len(body) < _CRC_BYTES or (crc and zlib.crc32(body[:-_CRC_BYTES]) != crc):
        raise DamagedData("checksum mismatch")
    return parse(Attachment, body)
