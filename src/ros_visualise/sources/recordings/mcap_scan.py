"""The index of an MCAP file whose own is missing or wrong, made from all whole records."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode
from mcap.records import Statistics

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.mcap_index import Index, indexed_stamps, read_statistics
from ros_visualise.sources.recordings.mcap_records import (
    ANY_CHANNEL,
    CHUNK_HEAD_BYTES,
    COMPRESSIONS,
    EVER,
    HEAD,
    HEAD_BYTES,
    MAGIC,
    chunk_head,
    decompress,
    described,
    describing,
    messages,
)
from ros_visualise.sources.recordings.unpacking import DamagedData

_RUN_BYTES = 1 << 20
_COUNTED = (
    ("chunk", Opcode.CHUNK, Opcode.CHUNK_INDEX),
    ("attachment", Opcode.ATTACHMENT, Opcode.ATTACHMENT_INDEX),
    ("metadata", Opcode.METADATA, Opcode.METADATA_INDEX),
)
_MESSAGE_HEAD = struct.Struct("<H4xQ")
_CHECKSUM = struct.Struct("<I")
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


def scan(file: BinaryIO, size: int) -> tuple[Index, Loss]:
    """The index of all whole records, and the rest.

    Where the file counts other messages than the index records behind its chunks do, the chunks
    themselves are read.
    """
    for opens in (False, True):
        loss = Loss()
        pieces = _Pieces(file, loss, opens)
        for record in walk(file, size, loss):
            pieces.take(record)
        pieces.finish()
        if not pieces.differs:
            break
    pieces.compare()
    pieces.check()
    return pieces.index, loss


@dataclass
class _ScannedPiece:
    """A chunk, or messages that follow one another outside chunks, from ``start`` to ``end``.

    A chunk's own index follows it, until ``index_end``; ``indexed_ns``: the least and greatest
    stamps of its channels.
    """

    start: int
    end: int
    index_end: int
    span_ns: tuple[int, int]
    counts: Counter[int] = field(default_factory=Counter)
    indexed_ns: list[int] = field(default_factory=list)


class _Pieces:
    """Makes an index of records; opens only chunks without a whole index behind them, or all."""

    def __init__(self, file: BinaryIO, loss: Loss, opens: bool) -> None:
        self._file, self._loss, self._opens = file, loss, opens
        self.index = Index()
        self._chunk: _ScannedPiece | None = None
        self._run: _ScannedPiece | None = None
        self._disputed: list[int] = []  # where chunks begin that hold other than their index says
        self._missing = 0  # messages that those do not hold
        self._statistics: Statistics | None = None
        self._seen: Counter[int] = Counter()
        self._data_end: McapRecord | None = None

    def take(self, record: McapRecord) -> None:
        """Add the next record."""
        self._seen[record.kind] += 1
        if record.kind == Opcode.MESSAGE_INDEX:
            self._count_in_chunk(record)
            return
        self._end_chunk(next_start=record.start)
        if record.kind == Opcode.MESSAGE:
            self._add_message(record)
        elif record.kind in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.index.describe(filter(None, [describing(record.kind, self._body(record))]))
        elif record.kind == Opcode.CHUNK:
            self._begin_chunk(record)
        elif record.kind in (Opcode.ATTACHMENT, Opcode.METADATA):
            self.index.extras.append((record.start, record.end - record.start))
        elif record.kind == Opcode.STATISTICS:
            self._statistics = read_statistics(self._body(record))
        elif record.kind == Opcode.DATA_END:
            self._data_end = record

    def finish(self) -> None:
        """Add what is open."""
        self._end_chunk()
        self._end_run()

    @property
    def differs(self) -> bool:
        """True if the file counts other messages than were found."""
        found = +Counter(self.index.counts)
        return self._statistics is not None and _counted(self._statistics, found) != found

    def compare(self) -> None:
        """Compare what was found with the counts of the file."""
        counts = self.index.counts
        found = +Counter(counts)
        unknown = sum(counts.pop(channel) for channel in counts.keys() - self.index.channels.keys())
        if unknown:
            self._loss.add(f"{unknown} messages on channels without a description")
        declared = found if self._statistics is None else _counted(self._statistics, found)
        missing = (declared - found).total()
        if self._statistics is not None:
            missing = max(missing, self._statistics.message_count - found.total())
        self._loss.messages = max(self._loss.messages + unknown, missing, self._missing)
        for note in self._differences(found, declared):
            if not self._loss.notes:  # which say why
                self._loss.add(note)

    def check(self) -> None:
        """Check messages outside chunks, which have no checksums, against the file's own."""
        end = self._data_end
        if end is None or self._loss or not self._seen[Opcode.MESSAGE]:
            return
        (crc,) = _CHECKSUM.unpack_from(end.head, HEAD_BYTES)
        if crc and _checksum(self._file, end.start) != crc:  # 0: the writer made none
            self._loss.add("checksum mismatch")

    def _differences(self, found: Counter[int], declared: Counter[int]) -> Iterator[str]:
        """Notes on what the file counts, and lacks or has more of."""
        seen, statistics = self._seen, self._statistics
        if found != declared:
            there, counted = found.total(), declared.total()
            lists = f"its statistics record lists {counted} messages"
            if counted != there:
                yield f"{lists}; found {there}"
            else:
                yield f"{lists}, as found, but different counts for some topics"
        for what, kind, index in _COUNTED:
            counts = [seen[index]] if seen[index] else []
            if statistics is not None:
                counts.append(getattr(statistics, f"{what}_count"))
            for count in counts:
                if count != seen[kind]:
                    yield f"its index lists {count} {what} records; found {seen[kind]}"
        if statistics is not None and statistics.message_count != declared.total():
            yield "its statistics contradict each other"
        for start in self._disputed:
            yield f"the chunk at byte {start} and its index contradict each other"

    def _whole(self, record: McapRecord) -> bytes:
        self._file.seek(record.start)
        return self._file.read(record.end - record.start)

    def _body(self, record: McapRecord) -> bytes:
        return self._whole(record)[HEAD_BYTES:]

    def _add_message(self, record: McapRecord) -> None:
        found = record.messages or [_MESSAGE_HEAD.unpack_from(record.head, HEAD_BYTES)]
        channels, stamps_ns = zip(*found, strict=True)
        run = self._run
        if run is None or run.end != record.start or run.end - run.start > _RUN_BYTES:
            self._end_run()
            span_ns = (stamps_ns[0], stamps_ns[0])
            self._run = run = _ScannedPiece(record.start, record.end, record.end, span_ns)
        run.end = record.end
        run.span_ns = (min(run.span_ns[0], *stamps_ns), max(run.span_ns[1], *stamps_ns))
        run.counts.update(channels)

    def _end_run(self) -> None:
        if self._run is not None:
            self.index.compressions.add(COMPRESSIONS[""])
            self._add(self._run, self._run.span_ns, self._run.counts, is_chunk=False)
        self._run = None

    def _begin_chunk(self, record: McapRecord) -> None:
        self._end_run()
        head = chunk_head(record.head)
        self.index.compressions.add(COMPRESSIONS.get(head.compression, head.compression))
        span_ns = (head.start_ns, head.end_ns)
        self._chunk = _ScannedPiece(record.start, record.end, record.end, span_ns)

    def _count_in_chunk(self, record: McapRecord) -> None:
        chunk = self._chunk
        if chunk is None or chunk.index_end != record.start:
            return
        for channel, stamps_ns in indexed_stamps(self._whole(record)):
            chunk.counts[channel] += len(stamps_ns)
            if len(stamps_ns):
                chunk.indexed_ns += [int(stamps_ns.min()), int(stamps_ns.max())]
            chunk.index_end = record.end

    def _end_chunk(self, next_start: int | None = None) -> None:
        """Add the chunk; ``next_start``: place of the record behind its index."""
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        indexed_ns = (min(chunk.indexed_ns, default=0), max(chunk.indexed_ns, default=0))
        is_indexed = (
            not self._opens
            and chunk.index_end == next_start
            and bool(chunk.indexed_ns)
            and indexed_ns == chunk.span_ns
        )
        if is_indexed and self.index.knows(chunk.counts):
            self._add(chunk, chunk.span_ns, chunk.counts)
        else:
            self._open_chunk(chunk)

    def _open_chunk(self, chunk: _ScannedPiece) -> None:
        self._file.seek(chunk.start)
        try:
            records = decompress(self._file.read(chunk.end - chunk.start))
        except DamagedData as damage:
            why = f"the chunk at byte {chunk.start} is damaged: {damage}"
            self._loss.add(why, chunk.counts.total(), chunk.end - chunk.start)
            return
        self.index.describe(described(records))
        found, _ = messages(records, ANY_CHANNEL, *EVER)
        counts = Counter(channel for _, channel, *_ in found)
        if chunk.counts and chunk.counts != counts:
            self._disputed.append(chunk.start)
            self._missing += (chunk.counts - counts).total()
        if found:
            self._add(chunk, (found[0][0], found[-1][0]), counts)

    def _add(
        self,
        piece: _ScannedPiece,
        span_ns: tuple[int, int],
        counts: Counter[int],
        is_chunk: bool = True,
    ) -> None:
        self.index.count(counts)
        length = piece.end - piece.start
        self.index.add(piece.start, length, span_ns, counts.total(), set(counts), is_chunk)


def _counted(statistics: Statistics, found: Counter[int]) -> Counter[int]:
    """The declared messages of each channel; of a file that counts only all, as they are found."""
    if statistics.channel_message_counts:
        return +Counter(statistics.channel_message_counts)
    total = statistics.message_count
    missing = total - found.total()
    return found + Counter({-1: missing}) if missing >= 0 else Counter({-1: total})


def _checksum(file: BinaryIO, end: int) -> int:
    """The CRC-32 of all bytes before ``end``."""
    crc = 0
    file.seek(0)
    for start in range(0, end, _RUN_BYTES):
        crc = zlib.crc32(file.read(min(_RUN_BYTES, end - start)), crc)
    return crc


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
        what = f"it has {size} of at least {needed} bytes"
    loss.add(f"its end is missing: cut off, or never closed by its recorder; {what}")
