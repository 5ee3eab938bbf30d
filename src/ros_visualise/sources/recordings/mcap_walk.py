"""The records of an MCAP file in their order, also those around damaged bytes."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.mcap_records import (
    CHUNK_HEAD_BYTES,
    HEAD,
    HEAD_BYTES,
    MAGIC,
    chunk_head,
)
from ros_visualise.sources.recordings.unpacking import DamagedData

_RUN_BYTES = 1 << 20
_ANY = 2**63 - 1
_LENGTHS: dict[int, tuple[int, int]] = {
    Opcode.HEADER: (8, _ANY),
    Opcode.FOOTER: (20, 20),
    Opcode.SCHEMA: (14, _ANY),
    Opcode.CHANNEL: (16, _ANY),
    Opcode.MESSAGE: (22, _ANY),
    Opcode.CHUNK: (40, _ANY),
    Opcode.MESSAGE_INDEX: (6, _ANY),
    Opcode.CHUNK_INDEX: (64, _ANY),
    Opcode.ATTACHMENT: (36, _ANY),
    Opcode.ATTACHMENT_INDEX: (48, _ANY),
    Opcode.STATISTICS: (46, _ANY),
    Opcode.METADATA: (8, _ANY),
    Opcode.METADATA_INDEX: (20, _ANY),
    Opcode.SUMMARY_OFFSET: (17, 17),
    Opcode.DATA_END: (4, 4),
}
_LEAST, _MOST = (
    np.array([_LENGTHS.get(kind, (_ANY, 0))[side] for kind in range(256)]) for side in (0, 1)
)
_CHAIN = 3  # that many whole records in a row do not come about by chance
_SEARCH_BYTES = 1 << 20
_SMALL_BYTES = 1 << 16
_MESSAGE = struct.Struct("<BQHIQ")


class McapRecord(NamedTuple):
    """A record from ``start`` to ``end`` of the file, and its first bytes.

    A chunk that is cut off ends with the file. Small messages that follow one another come as one,
    with their channels and log times.
    """

    start: int
    end: int
    kind: int
    head: bytes
    messages: Sequence[tuple[int, int]] = ()


def walk(file: BinaryIO, size: int, loss: Loss) -> Iterator[McapRecord]:
    """All whole records, and a last chunk; ``loss`` gets what lies between and after them."""
    position = len(MAGIC)
    needed = size
    last: McapRecord | None = None
    while position < size:
        record = _record(file, position, size)
        if record is not None:
            if last is not None:
                yield last
            last = record
            if record.kind == Opcode.MESSAGE:
                run = _run(file, record, size)
                if run is not None:
                    yield run
                    last, position = None, run.end
                    continue
            position = record.end
            if record.kind == Opcode.FOOTER:
                break
            continue
        # A message whose length is damaged ends in the midst of others: look for them there.
        is_doubtful = last is not None and last.kind == Opcode.MESSAGE
        start = last.start if last is not None and is_doubtful else position
        cut = _cut_chunk(file, position, size)
        found = None if cut else _find(file, start + 1, size)
        if last is not None and (found is None or found >= position):
            yield last
        elif last is not None:
            position = last.start
        last = cut
        if cut:
            position, needed = size, position + chunk_head(cut.head).end
            break
        if found is None:
            break
        lost = found - position
        loss.add(f"{lost} damaged bytes at byte {position}", size=lost)
        position = found
    if last is not None:
        yield last
    _check_end(file, position, size, needed, last, loss)


def _record(file: BinaryIO, start: int, size: int) -> McapRecord | None:
    file.seek(start)
    head = file.read(CHUNK_HEAD_BYTES)
    if len(head) < HEAD_BYTES:
        return None
    kind, length = HEAD.unpack_from(head)
    end = start + HEAD_BYTES + length
    if end > size or not _is_likely(kind, length, head):
        return None
    return McapRecord(start, end, kind, head)


def _run(file: BinaryIO, first: McapRecord, size: int) -> McapRecord | None:
    """The messages from a small one on that are each followed by another, if any."""
    if first.end - first.start > _SMALL_BYTES:
        return None
    file.seek(first.start)
    block = file.read(_RUN_BYTES)
    limit, left = len(block) - _MESSAGE.size, size - first.start
    unpack, kind_message, least = (
        _MESSAGE.unpack_from,
        int(Opcode.MESSAGE),
        _LENGTHS[Opcode.MESSAGE][0],
    )
    found: list[tuple[int, int]] = []
    start = after = 0
    while after <= limit:
        kind, length, channel, _, stamp_ns = unpack(block, after)
        end = after + HEAD_BYTES + length
        if kind != kind_message or length < least or end > left:
            break
        found.append((channel, stamp_ns))
        start, after = after, end
    if len(found) < 2:
        return None
    return McapRecord(first.start, first.start + start, kind_message, first.head, found[:-1])


def _is_likely(kind: int, length: int, head: bytes) -> bool:
    if kind not in _LENGTHS:
        return kind != 0  # to be skipped: of a later version, or private
    if kind == Opcode.CHUNK:
        return _is_chunk(head)
    least, most = _LENGTHS[kind]
    return least <= length <= most


def _is_chunk(head: bytes) -> bool:
    try:
        chunk_head(head)
    except DamagedData:
        return False
    return True


def _cut_chunk(file: BinaryIO, start: int, size: int) -> McapRecord | None:
    """A chunk whose start is whole, and whose end the file lacks."""
    file.seek(start)
    head = file.read(CHUNK_HEAD_BYTES)
    return McapRecord(start, size, Opcode.CHUNK, head) if _is_chunk(head) else None


def _find(file: BinaryIO, start: int, size: int) -> int | None:
    """Beginning of the next record that others follow."""
    while start < size:
        file.seek(start)
        block = np.frombuffer(file.read(_SEARCH_BYTES), np.uint8)
        count = len(block) - HEAD_BYTES + 1
        if count <= 0:
            return None
        for candidate in _candidates(block, count).tolist():
            if _begins_chain(file, start + candidate, size):
                return start + int(candidate)
        start += count
    return None


def _candidates(block: npt.NDArray[np.uint8], count: int) -> npt.NDArray[np.intp]:
    """Places in a block at which a known kind is followed by a valid length, below 1 TB."""
    kinds = block[:count]
    is_one = (kinds > 0) & (kinds <= max(_LENGTHS))
    for high_byte in (6, 7, 8):
        is_one &= block[high_byte : high_byte + count] == 0
    at = np.flatnonzero(is_one)
    lengths = np.zeros(len(at), np.int64)
    for byte in range(5):
        lengths |= block[at + 1 + byte].astype(np.int64) << (8 * byte)
    is_likely = (lengths >= _LEAST[kinds[at]]) & (lengths <= _MOST[kinds[at]])
    return at[is_likely]


def _begins_chain(file: BinaryIO, position: int, size: int) -> bool:
    for _ in range(_CHAIN):
        record = _record(file, position, size)
        if record is None or record.kind not in _LENGTHS:
            return False
        if record.kind == Opcode.FOOTER or record.end == size:
            return True
        position = record.end
    return True


def _check_end(
    file: BinaryIO, position: int, size: int, needed: int, last: McapRecord | None, loss: Loss
) -> None:
    """Note what follows the last record, and what is missing of the file's ``needed`` bytes."""
    file.seek(position)
    is_closed = last is not None and last.kind == Opcode.FOOTER
    rest = needed - position
    if is_closed and file.read(len(MAGIC) + 1) == MAGIC:
        return
    loss.bytes += rest
    if is_closed and rest >= len(MAGIC):
        loss.add(f"{rest} extra bytes after its end")
        return
    what = f"readable up to byte {position} of {size}"
    if needed > size:
        what = f"it has only {size} of at least {needed} bytes"
    loss.add(f"its end is missing: cut off, or never closed by its recorder; {what}")
