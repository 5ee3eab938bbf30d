"""An MCAP file's index where its own is missing or wrong: made from all records that are whole."""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.mcap_index import (
    Index,
    indexed_stamps,
    read_statistics,
)
from ros_visualise.sources.recordings.mcap_records import (
    ANY_CHANNEL,
    COMPRESSIONS,
    EVER,
    HEAD_BYTES,
    Damaged,
    chunk_head,
    decompress,
    described,
    messages,
    read_channel,
    read_schema,
)
from ros_visualise.sources.recordings.mcap_walk import Record, walk
from ros_visualise.sources.recordings.storage import add_note

_RUN_BYTES = 1 << 20
_MESSAGE_HEAD = struct.Struct("<H4xQ")


def scan(file: BinaryIO, size: int, loss: Loss) -> Index:
    """The index of all whole records; ``loss`` says what is not."""
    pieces = _Pieces(file, loss)
    for record in walk(file, size, loss):
        pieces.take(record)
    return pieces.finish()


@dataclass
class _Piece:
    """A chunk, or messages that follow one another outside chunks, from ``start`` to ``end``.

    A chunk's own index follows it, until ``told_end``; ``told_ns``: the least and greatest stamps
    of its channels.
    """

    start: int
    end: int
    told_end: int
    span_ns: tuple[int, int]
    counts: Counter[int] = field(default_factory=Counter)
    told_ns: list[int] = field(default_factory=list)


class _Pieces:
    """Makes pieces of records; opens a chunk only where what follows it does not tell enough."""

    def __init__(self, file: BinaryIO, loss: Loss) -> None:
        self._file, self._loss = file, loss
        self._index = Index()
        self._chunk: _Piece | None = None
        self._run: _Piece | None = None
        self._claimed = 0

    def take(self, record: Record) -> None:
        """Add the next record."""
        if record.kind == Opcode.MESSAGE_INDEX:
            self._count_in_chunk(record)
            return
        self._end_chunk(next_start=record.start)
        if record.kind == Opcode.MESSAGE:
            self._add_message(record)
        elif record.kind == Opcode.SCHEMA:
            self._index.describe(filter(None, [read_schema(self._body(record))]), [])
        elif record.kind == Opcode.CHANNEL:
            self._index.describe([], filter(None, [read_channel(self._body(record))]))
        elif record.kind == Opcode.CHUNK:
            self._begin_chunk(record)
        elif record.kind in (Opcode.ATTACHMENT, Opcode.METADATA):
            self._index.extras.append((record.start, record.end - record.start))
        elif record.kind == Opcode.STATISTICS:
            statistics = read_statistics(self._body(record))
            self._claimed = statistics.message_count if statistics else 0

    def finish(self) -> Index:
        """The index of all that was added."""
        self._end_chunk()
        self._end_run()
        counts = self._index.counts
        unknown = sum(
            counts.pop(channel) for channel in counts.keys() - self._index.channels.keys()
        )
        if unknown:
            add_note(self._loss, f"{unknown} messages of channels that it does not describe")
        missing = self._claimed - sum(counts.values())
        if missing > 0 and not self._loss.notes:  # which say why
            add_note(self._loss, f"of {self._claimed} messages {missing} are missing")
        self._loss.messages = max(self._loss.messages + unknown, missing)
        return self._index

    def _whole(self, record: Record) -> bytes:
        self._file.seek(record.start)
        return self._file.read(record.end - record.start)

    def _body(self, record: Record) -> bytes:
        return self._whole(record)[HEAD_BYTES:]

    def _add_message(self, record: Record) -> None:
        found = record.messages or [_MESSAGE_HEAD.unpack_from(record.head, HEAD_BYTES)]
        channels, stamps_ns = zip(*found, strict=True)
        run = self._run
        if run is None or run.end != record.start or run.end - run.start > _RUN_BYTES:
            self._end_run()
            span_ns = (stamps_ns[0], stamps_ns[0])
            self._run = run = _Piece(record.start, record.end, record.end, span_ns)
        run.end = record.end
        run.span_ns = (min(run.span_ns[0], *stamps_ns), max(run.span_ns[1], *stamps_ns))
        run.counts.update(channels)

    def _end_run(self) -> None:
        if self._run is not None:
            self._index.compressions.add(COMPRESSIONS[""])
            self._add(self._run, self._run.span_ns, self._run.counts, is_chunk=False)
        self._run = None

    def _begin_chunk(self, record: Record) -> None:
        self._end_run()
        head = chunk_head(record.head)
        self._index.compressions.add(COMPRESSIONS.get(head.compression, head.compression))
        span_ns = (head.start_ns, head.end_ns)
        self._chunk = _Piece(record.start, record.end, record.end, span_ns)

    def _count_in_chunk(self, record: Record) -> None:
        chunk = self._chunk
        if chunk is None or chunk.told_end != record.start:
            return
        for channel, stamps_ns in indexed_stamps(self._whole(record)):
            chunk.counts[channel] += len(stamps_ns)
            chunk.told_ns += [int(stamps_ns.min()), int(stamps_ns.max())] if len(stamps_ns) else []
            chunk.told_end = record.end

    def _end_chunk(self, next_start: int | None = None) -> None:
        """Add the chunk; ``next_start``: where another record than an index of it follows."""
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        told_ns = (min(chunk.told_ns, default=0), max(chunk.told_ns, default=0))
        is_told = chunk.told_end == next_start and bool(chunk.told_ns) and told_ns == chunk.span_ns
        if is_told and chunk.counts.keys() <= self._index.channels.keys():
            self._add(chunk, chunk.span_ns, chunk.counts)
        else:
            self._open_chunk(chunk)

    def _open_chunk(self, chunk: _Piece) -> None:
        self._file.seek(chunk.start)
        try:
            records = decompress(self._file.read(chunk.end - chunk.start))
        except Damaged as damage:
            self._loss.bytes += chunk.end - chunk.start
            self._loss.messages += chunk.counts.total()
            add_note(self._loss, f"the chunk at byte {chunk.start} is damaged: {damage}")
            return
        schemas, channels = described(records)
        self._index.describe(schemas.values(), channels.values())
        found, _ = messages(records, ANY_CHANNEL, *EVER)
        if found:
            span_ns = (found[0][0], found[-1][0])
            self._add(chunk, span_ns, Counter(channel for _, channel, *_ in found))

    def _add(
        self, piece: _Piece, span_ns: tuple[int, int], counts: Counter[int], is_chunk: bool = True
    ) -> None:
        self._index.count(counts)
        length = piece.end - piece.start
        self._index.add(piece.start, length, span_ns, counts.total(), set(counts), is_chunk)
