"""MCAP files with ROS messages: whole, cut off anywhere, or damaged in places."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt
from mcap.records import Channel as McapChannel
from mcap.records import Schema

from ros_visualise.core.errors import DamagedMessage, OpenError, TooLarge
from ros_visualise.core.limits import check_file
from ros_visualise.core.regular_files import open_file
from ros_visualise.messages.definitions import Encoding
from ros_visualise.sources.recordings import Extra, Loss, Recording
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
    Damaged,
    decompress,
    messages,
    parse_extra,
)
from ros_visualise.sources.recordings.mcap_scan import scan
from ros_visualise.sources.recordings.merging import MergedRecording
from ros_visualise.sources.recordings.pieces import ChunkPiece, Place, Records, Shelf
from ros_visualise.sources.recordings.schemas import Schemas, digest, is_latched, ros_name
from ros_visualise.sources.recordings.storage import Channel, Piece, Query, add_note


def open_mcap(path: Path) -> Recording:
    """Open an MCAP file.

    Raises:
        OpenError: it cannot be read, or is none.
    """
    loss = Loss()
    return MergedRecording(path, "mcap", [McapFile(path, Schemas(), loss)], loss)


class McapFile:
    """One MCAP file; a `Storage`, whose pieces are chunks and runs of messages between them.

    Where the writer's index is there and agrees with the file, nothing else is read at first.

    Args:
        path: of the file.
        schemas: of its recording.
        loss: where to say what cannot be read.
        label: what begins each note of that, where the recording has more files.

    Raises:
        OpenError: it cannot be read, or is none.
    """

    def __init__(self, path: Path, schemas: Schemas, loss: Loss, label: str = "") -> None:
        self._loss, self._label = loss, label
        self._lock = threading.Lock()
        self._is_indexed = False
        self._file = _open(path)
        try:
            self.size = path.stat().st_size
            index = self._index()
        except OSError as error:
            self._file.close()
            raise OpenError(f"{path}: {error.strerror}; copy it again") from None
        self._rows = index.rows
        self._channel_sets = index.channel_sets
        self._extras = index.extras
        self.starts_ns, self.ends_ns = self._rows["start_ns"], self._rows["end_ns"]
        self.counts: Mapping[int, int] = index.counts
        self.compressions: Collection[str] = index.compressions or {"none"}
        self.channels: Mapping[int, Channel] = {
            number: describe(channel, index.schemas.get(channel.schema_id), schemas)
            for number, channel in index.channels.items()
        }
        self._damaged: set[int] = set()
        self._seen = np.zeros(len(self._rows), bool)  # pieces whose messages were counted
        self._found: Counter[int] = Counter()

    def select(self, query: Query) -> npt.NDArray[np.intp]:
        wanted = {n for n, channel in self.channels.items() if query.asks_for(channel)}
        holds = np.array([not wanted.isdisjoint(s) for s in self._channel_sets] + [bool(wanted)])
        rows = self._rows
        is_asked = holds[rows["channels"]]  # a set that is UNKNOWN takes the last
        if query.start_ns > -(2**63):
            is_asked &= rows["end_ns"] >= query.start_ns
        if query.stop_ns < 2**63:
            is_asked &= rows["start_ns"] < query.stop_ns
        return np.flatnonzero(is_asked)

    def open_piece(self, piece: int, query: Query, shelf: Shelf) -> Piece:
        records = self._load(piece) or b""
        wanted = {
            number: (channel.topic, channel.type_name, channel.definitions)
            for number, channel in self.channels.items()
            if query.asks_for(channel) and channel.definitions
        }
        found, is_whole = messages(records, wanted, query.start_ns, query.stop_ns)
        known = int(self._rows[piece]["messages"])
        is_short = bool(records) and len(found) < known and self._is_all(piece, query, wanted)
        if is_short or not is_whole:
            there = found if is_short else messages(records, ANY_CHANNEL, *EVER)[0]
            why = "its records contradict each other"
            self._lose(piece, why, max(0, known - len(there)))
        elif known == UNKNOWN:
            self._look_at_all(piece, records)
        elif records and self._is_all(piece, query, wanted):
            self._compare(piece, *_contents(found))
        return ChunkPiece(found, wanted, records, partial(self._load, piece, check=False), shelf)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """As `Storage.stamps_ns`; from the index behind each chunk, where it is whole."""
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
            except (OSError, Damaged, TooLarge) as damage:
                note = f"an attachment or metadata at byte {offset} is lost: {damage}"
                add_note(self._loss, f"{self._label}{note}")

    def close(self) -> None:
        with self._lock:
            self._file.close()

    def _is_all(self, piece: int, query: Query, wanted: Collection[int]) -> bool:
        """True if all that a piece holds, by its index, is asked for."""
        row = self._rows[piece]
        is_in_time = query.start_ns <= row["start_ns"] and row["end_ns"] < query.stop_ns
        held = self._channel_sets[row["channels"]] if row["channels"] != UNKNOWN else None
        return bool(is_in_time and held is not None and held.issubset(wanted))

    def _index(self) -> Index:
        """The file's own index; else one that is made by looking through the file."""
        why = ""
        try:
            if index := read_index(self._file, self.size):
                self._is_indexed = True
                return index
        except Damaged as damage:
            why = f"its index is damaged: {damage}; all messages were found without it"
        found = Loss()
        index = scan(self._file, self.size, found)
        if why and not found:
            add_note(found, why)
        self._loss.messages += found.messages
        self._loss.bytes += found.bytes
        for note in found.notes:
            add_note(self._loss, f"{self._label}{note}")
        return index

    def _compare(
        self, piece: int, found: Counter[int], span_ns: Collection[int] | None = None
    ) -> None:
        """Hold the messages in a piece against its index, and those of all against the file's.

        Args:
            found: messages by channel.
            span_ns: the first and the last of their stamps, where the messages themselves say so.
        """
        if self._seen[piece] or piece in self._damaged:
            return
        row = self._rows[piece]
        if span_ns and not all(row["start_ns"] <= one <= row["end_ns"] for one in span_ns):
            note = f"the piece at byte {row['offset']} has messages outside the times of its index"
            add_note(self._loss, f"{self._label}{note}")
        told = Counter({n: len(stamps_ns) for n, stamps_ns in self._indexed_stamps(piece)})
        is_told = self._is_indexed and UNKNOWN not in (row["messages"], row["channels"])
        if row["messages"] not in (UNKNOWN, found.total()) or (is_told and told != found):
            note = f"the piece at byte {row['offset']} and its index contradict each other"
            add_note(self._loss, f"{self._label}{note}")
        self._seen[piece] = True
        self._found += found
        if self._seen.all() and not self._loss and self._found != +Counter(self.counts):
            self._loss.messages += max(0, sum(self.counts.values()) - self._found.total())
            add_note(self._loss, f"{self._label}its statistics count other messages of its topics")

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
        """The records of a piece; None where they are damaged, or the file is closed."""
        row = self._rows[piece]
        try:
            data = self._bytes(int(row["offset"]), int(row["length"]))
        except OSError as error:
            self._lose(piece, f"{error.strerror}", int(row["messages"]))
            return None
        if data is None:
            return None
        try:
            return decompress(data, check) if row["is_chunk"] else data
        except Damaged as damage:
            self._lose(piece, str(damage), int(row["messages"]))
            return None

    def _bytes(self, offset: int, length: int) -> bytes | None:
        """A part of the file; None once it is closed."""
        with self._lock:
            if self._file.closed:
                return None
            self._file.seek(offset)
            return self._file.read(length)

    def _look_at_all(self, piece: int, records: Records) -> None:
        """Compare a piece of which no index says what it holds."""
        if self._seen[piece] or not records:
            return
        counts, span_ns = _contents(messages(records, ANY_CHANNEL, *EVER)[0])
        strangers = sum(n for channel, n in counts.items() if channel not in self.channels)
        if strangers:
            self._lose(piece, "messages of channels that it does not describe", strangers)
        self._compare(piece, counts, span_ns)

    def _lose(self, piece: int, why: str, messages: int) -> None:
        if piece in self._damaged:
            return
        self._damaged.add(piece)
        row = self._rows[piece]
        self._loss.bytes += int(row["length"])
        self._loss.messages += 0 if messages == UNKNOWN else messages
        add_note(self._loss, f"{self._label}the piece at byte {row['offset']} is lost: {why}")


def _contents(found: list[Place]) -> tuple[Counter[int], list[int]]:
    """Messages by channel; the first and the last stamp, if there are any."""
    counts = Counter(channel for _, channel, *_ in found)
    return counts, [stamp_ns for stamp_ns, *_ in found[:1] + found[-1:]]


def _open(path: Path) -> BinaryIO:
    try:
        file = open_file(path)
        start = file.read(len(MAGIC))
    except PermissionError:
        raise OpenError(f"{path}: you may not read it; try chmod u+r") from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}; give an MCAP file") from None
    if start != MAGIC:
        file.close()
        what = "no MCAP file; check the path" if start else "an empty file; record or copy it again"
        raise OpenError(f"{path}: {what}")
    return file


_ENCODINGS: Mapping[str, Encoding] = {"ros1": "ros1", "cdr": "cdr"}
_LANGUAGES = {"ros1": ("ros1msg",), "cdr": ("ros2msg", "ros2idl")}
_UNDERSTOOD = ("callerid", "latching", "md5sum", "offered_qos_profiles", "topic_type_hash")


def describe(channel: McapChannel, schema: Schema | None, schemas: Schemas) -> Channel:
    """A channel of an MCAP file as its messages are to be read.

    Args:
        schema: its own, if the file has it.
        schemas: those of the recording, to which it is added.
    """
    encoding = channel.message_encoding
    if encoding not in _LANGUAGES:
        why = f"{encoding or 'no encoding'}: only ROS messages are read"
    elif schema is None:
        why = f"{encoding}: it has no schema"
    else:
        return _ros_channel(channel, schema, schemas)
    return Channel(channel.topic, schema.name if schema else "", unreadable=why)


def _ros_channel(channel: McapChannel, schema: Schema, schemas: Schemas) -> Channel:
    encoding = channel.message_encoding
    name = ros_name(schema.name)
    found = Channel(
        channel.topic,
        name,
        latched=_is_latched(channel),
        offered_qos=channel.metadata.get("offered_qos_profiles", ""),
        callerid=channel.metadata.get("callerid", ""),
        labels=tuple(pair for pair in channel.metadata.items() if pair[0] not in _UNDERSTOOD),
    )
    if schema.encoding not in _LANGUAGES[encoding]:
        why = f"{schema.encoding or 'no schema'}: only ROS's own definitions are read"
        return replace(found, unreadable=why)
    is_idl = schema.encoding == "ros2idl"
    text = schema.data.decode("utf-8", "replace")
    try:
        definitions = schemas.define(_ENCODINGS[encoding], name, text, is_idl)
    except DamagedMessage as damage:
        if is_idl:
            return replace(found, unreadable=str(damage))
        given, why = _given_digest(channel), str(damage)
        kept = schemas.keep(_ENCODINGS[encoding], name, text, given, why)
        return replace(found, definitions=kept, digest=given, unreadable=why)
    told = _given_digest(channel) or digest(definitions, name)
    return replace(found, definitions=definitions, digest=told)


def _given_digest(channel: McapChannel) -> str:
    return channel.metadata.get("topic_type_hash") or channel.metadata.get("md5sum") or ""


def _is_latched(channel: McapChannel) -> bool:
    if channel.metadata.get("latching", "0").lower() in ("1", "true"):
        return True
    return is_latched(channel.metadata.get("offered_qos_profiles", ""))
