"""The index of an MCAP file whose own is missing or wrong, made from all whole records."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Statistics

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.mcap_index import Index, indexed_stamps, read_statistics
from ros_visualise.sources.recordings.mcap_records import (
    ANY_CHANNEL,
    COMPRESSIONS,
    EVER,
    HEAD_BYTES,
    chunk_head,
    decompress,
    described,
    describing,
    messages,
)
from ros_visualise.sources.recordings.mcap_walk import McapRecord, walk
from ros_visualise.sources.recordings.unpacking import DamagedData

_RUN_BYTES = 1 << 20
_COUNTED = (
    ("chunk", Opcode.CHUNK, Opcode.CHUNK_INDEX),
    ("attachment", Opcode.ATTACHMENT, Opcode.ATTACHMENT_INDEX),
    ("metadata", Opcode.METADATA, Opcode.METADATA_INDEX),
)
_MESSAGE_HEAD = struct.Struct("<H4xQ")
_CHECKSUM = struct.Struct("<I")


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
