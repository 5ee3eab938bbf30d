"""MCAP files with ROS messages: whole, cut off anywhere, or damaged in places.

Source: the MCAP format specification; mcap.dev/spec/registry, the profiles ``ros1`` and ``ros2``.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from ros_visualise.core.errors import OpenError, TooLarge
from ros_visualise.core.limits import check_file
from ros_visualise.core.regular_files import open_file
from ros_visualise.messages.definitions import Encoding
from ros_visualise.sources.recordings import Extra, Loss, PartialLoss, Recording
from ros_visualise.sources.recordings.mcap_index import (
    UNKNOWN,
    Index,
    index_bytes,
    indexed_stamps,
    read_index,
)
from ros_visualise.sources.recordings.mcap_records import (
    ANY_CHANNEL,
    EVER,
    MAGIC,
    decompress,
    messages,
    parse_extra,
)
from ros_visualise.sources.recordings.mcap_scan import scan
from ros_visualise.sources.recordings.merging import MergedRecording, open_storages
from ros_visualise.sources.recordings.pieces import ChunkPiece, PieceCache, Place, Records
from ros_visualise.sources.recordings.schemas import Schemas, is_latched, ros_name
from ros_visualise.sources.recordings.storage import Channel, MessageQuery, Piece
from ros_visualise.sources.recordings.unpacking import DamagedData

_ENCODINGS: Mapping[str, Encoding] = {"ros1": "ros1", "cdr": "cdr"}
_LANGUAGES = {"ros1": ("ros1msg",), "cdr": ("ros2msg", "ros2idl")}
_EMPTY = "the file is empty; record or copy it again"
_KNOWN_METADATA = ("callerid", "latching", "md5sum", "offered_qos_profiles", "topic_type_hash")


def open_mcap(path: Path) -> Recording:
    """Open an MCAP file; raises OpenError if it cannot be read."""
    loss = Loss()
    return MergedRecording(
        path, "mcap", open_storages(path, [path], McapFile, loss, ExitStack()), loss
    )


class McapFile:
    """One MCAP file; a `Storage`, whose pieces are chunks and runs of messages between them.

    If the writer's index agrees with the file, nothing else is read at first. Raises OpenError.
    """

    def __init__(self, path: Path, schemas: Schemas, loss: PartialLoss) -> None:
        self._loss = loss
        self._lock = threading.Lock()
        self._is_indexed = False
        self._file = open_file(path)
        try:
            self.size = path.stat().st_size
            if self._file.read(len(MAGIC)) != MAGIC:
                what = "not an MCAP file; check the path" if self.size else _EMPTY
                raise OpenError(f"{path}: {what}")
            index = self._index()
        except (OSError, OpenError):
            self._file.close()
            raise
        self._rows = index.rows
        self._channel_sets = index.channel_sets
        self._extras = index.extras
        self.starts_ns, self.ends_ns = self._rows["start_ns"], self._rows["end_ns"]
        self.counts: Mapping[int, int] = index.counts
        self.compressions: Collection[str] = index.compressions or {"none"}
        self.channels: Mapping[int, Channel] = {
            number: describe_channel(channel, index.schemas.get(channel.schema_id), schemas)
            for number, channel in index.channels.items()
        }
        self._damaged: set[int] = set()
        self._seen = np.zeros(len(self._rows), bool)  # pieces whose messages were counted
        self._found: Counter[int] = Counter()

    def select(self, query: MessageQuery) -> npt.NDArray[np.intp]:
        wanted = query.readable(self.channels).keys()
        holds = np.array([not wanted.isdisjoint(s) for s in self._channel_sets] + [bool(wanted)])
        is_asked = holds[self._rows["channels"]]  # a set that is UNKNOWN takes the last
        return np.flatnonzero(is_asked & query.is_within(self.starts_ns, self.ends_ns))

    def open_piece(self, piece: int, query: MessageQuery, cache: PieceCache) -> Piece:
        records = self._load(piece) or b""
        wanted = query.readable(self.channels)
        found, is_whole = messages(records, wanted, query.start_ns, query.stop_ns)
        known = int(self._rows[piece]["messages"])
        is_short = bool(records) and len(found) < known and self._is_all(piece, query, wanted)
        if is_short or not is_whole:
            there = found if is_short else messages(records, ANY_CHANNEL, *EVER)[0]
            why = "its records contradict each other"
            self._lose(piece, why, max(0, known - len(there)))
        elif known == UNKNOWN:
            self._compare_all(piece, records)
        elif records and self._is_all(piece, query, wanted):
            self._compare(piece, *_contents(found))
        return ChunkPiece(found, wanted, records, partial(self._load, piece, check=False), cache)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """Stamps from the index behind each chunk, if that is whole; else from the chunk."""
        for piece in range(len(self._rows)):
            counts: Counter[int] = Counter()
            for channel, stamps_ns in self._indexed_stamps(piece) or self._opened_stamps(piece):
                counts[channel] += len(stamps_ns)
                yield channel, stamps_ns
            if not self._file.closed:
                self._compare(piece, counts)

    def extras(self) -> Iterator[Extra]:
        for offset, length in self._extras:
            try:
                check_file(length)
                record = self._bytes(offset, length)
                if record is None:
                    return
                yield parse_extra(record)
            except (OSError, DamagedData, TooLarge) as damage:
                self._loss.add(f"an attachment or metadata at byte {offset} is lost: {damage}")

    def close(self) -> None:
        with self._lock:
            self._file.close()

    def _is_all(self, piece: int, query: MessageQuery, wanted: Collection[int]) -> bool:
        """True if all that a piece holds, by its index, is selected."""
        row = self._rows[piece]
        is_in_time = query.start_ns <= row["start_ns"] and row["end_ns"] < query.stop_ns
        held = self._channel_sets[row["channels"]] if row["channels"] != UNKNOWN else None
        return bool(is_in_time and held is not None and held.issubset(wanted))

    def _index(self) -> Index:
        """The file's own index; else one that is made by reading through the file."""
        why = ""
        try:
            if index := read_index(self._file, self.size):
                self._is_indexed = True
                return index
        except DamagedData as damage:
            why = f"its index is damaged: {damage}; all messages recovered without it"
        index, found = scan(self._file, self.size)
        if why and not found:
            found.add(why)
        self._loss.absorb(found)
        return index

    def _compare(
        self, piece: int, found: Counter[int], span_ns: Collection[int] | None = None
    ) -> None:
        """Compare the messages in a piece with its index, and those of all with the file's.

        Args:
            piece: its number.
            found: messages by channel.
            span_ns: the first and the last of the messages' own stamps, if they were read.
        """
        if self._seen[piece] or piece in self._damaged:
            return
        row = self._rows[piece]
        if span_ns and not all(row["start_ns"] <= one <= row["end_ns"] for one in span_ns):
            where = f"the data at byte {row['offset']}"
            self._loss.add(f"{where} has messages outside the time range of its index")
        indexed = Counter({n: len(stamps_ns) for n, stamps_ns in self._indexed_stamps(piece)})
        is_known = self._is_indexed and UNKNOWN not in (row["messages"], row["channels"])
        if row["messages"] not in (UNKNOWN, found.total()) or (is_known and indexed != found):
            self._loss.add(f"the data at byte {row['offset']} and its index contradict each other")
        self._seen[piece] = True
        self._found += found
        if self._seen.all() and not self._loss.whole and self._found != +Counter(self.counts):
            missing = max(0, sum(self.counts.values()) - self._found.total())
            self._loss.add("its statistics give a different number of messages", missing)

    def _indexed_stamps(self, piece: int) -> list[tuple[int, npt.NDArray[np.int64]]]:
        row = self._rows[piece]
        if not row["is_chunk"] or UNKNOWN in (row["messages"], row["channels"]):
            return []
        channels = len(self._channel_sets[row["channels"]])
        size = index_bytes(channels, int(row["messages"]))
        found = indexed_stamps(self._bytes(int(row["offset"] + row["length"]), size) or b"")
        is_whole = sum(len(stamps_ns) for _, stamps_ns in found) == row["messages"]
        return found if is_whole else []

    def _opened_stamps(self, piece: int) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        found, _ = messages(self._load(piece) or b"", self.channels, *EVER)
        table = np.array([place[:2] for place in found], np.uint64).reshape(-1, 2)
        for channel in np.unique(table[:, 1]):
            stamps_ns = table[table[:, 1] == channel, 0]
            yield int(channel), stamps_ns.astype(np.int64)

    def _load(self, piece: int, check: bool = True) -> Records | None:
        """The records of a piece; None if they are damaged, or the file is closed."""
        row = self._rows[piece]
        try:
            data = self._bytes(int(row["offset"]), int(row["length"]))
            return decompress(data, check) if data is not None and row["is_chunk"] else data
        except (OSError, DamagedData) as error:
            why = getattr(error, "strerror", None) or str(error)
            self._lose(piece, why, int(row["messages"]))
            return None

    def _bytes(self, offset: int, length: int) -> bytes | None:
        """A part of the file; None once it is closed."""
        with self._lock:
            if self._file.closed:
                return None
            self._file.seek(offset)
            return self._file.read(length)

    def _compare_all(self, piece: int, records: Records) -> None:
        """Compare a piece whose content no index knows."""
        if self._seen[piece] or not records:
            return
        counts, span_ns = _contents(messages(records, ANY_CHANNEL, *EVER)[0])
        strangers = sum(n for channel, n in counts.items() if channel not in self.channels)
        if strangers:
            self._lose(piece, "messages on channels without a description", strangers)
        self._compare(piece, counts, span_ns)

    def _lose(self, piece: int, why: str, messages: int) -> None:
        if piece in self._damaged:
            return
        self._damaged.add(piece)
        row = self._rows[piece]
        messages = 0 if messages == UNKNOWN else messages
        note = f"the data at byte {row['offset']} is lost: {why}"
        self._loss.add(note, messages, int(row["length"]))


def _contents(found: list[Place]) -> tuple[Counter[int], list[int]]:
    """Messages by channel; the first and the last stamp, if any."""
    counts = Counter(channel for _, channel, *_ in found)
    return counts, [stamp_ns for stamp_ns, *_ in found[:1] + found[-1:]]


def describe_channel(channel: McapChannel, schema: Schema | None, schemas: Schemas) -> Channel:
    """A channel as its messages are to be read; its schema is added to those of the recording."""
    encoding = channel.message_encoding
    if encoding not in _LANGUAGES:
        why = f"{encoding or 'no encoding'}: only ROS messages are supported"
    elif schema is None:
        why = f"{encoding}: no schema"
    else:
        return _ros_channel(channel, schema, schemas)
    return Channel(channel.topic, schema.name if schema else "", unreadable=why)


def _ros_channel(channel: McapChannel, schema: Schema, schemas: Schemas) -> Channel:
    encoding, metadata = channel.message_encoding, channel.metadata
    name, qos = ros_name(schema.name), metadata.get("offered_qos_profiles", "")
    found = Channel(
        channel.topic,
        name,
        latched=metadata.get("latching", "0").lower() in ("1", "true") or is_latched(qos),
        offered_qos=qos,
        callerid=metadata.get("callerid", ""),
        labels=tuple(pair for pair in metadata.items() if pair[0] not in _KNOWN_METADATA),
    )
    if schema.encoding not in _LANGUAGES[encoding]:
        why = f"{schema.encoding or 'no schema'}: only ROS definitions can be read"
        return replace(found, unreadable=why)
    given = metadata.get("topic_type_hash") or metadata.get("md5sum") or ""
    text, is_idl = schema.data.decode("utf-8", "replace"), schema.encoding == "ros2idl"
    return schemas.complete(found, _ENCODINGS[encoding], text, given, is_idl)
