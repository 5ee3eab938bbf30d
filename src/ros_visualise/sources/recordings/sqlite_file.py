"""SQLite files of rosbag2: whole, cut off or damaged in places."""

from __future__ import annotations

import sqlite3
import threading
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import OpenError
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings import Entry, Extra, Loss
from ros_visualise.sources.recordings.metadata import METADATA
from ros_visualise.sources.recordings.pieces import Shelf
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.sqlite_tables import (
    channels,
    connect,
    cut_rows,
    damage_by_name,
    has_index,
    is_spilled,
    left_beside,
    missing_bytes,
)
from ros_visualise.sources.recordings.storage import (
    Channel,
    Piece,
    Query,
    StreamedPiece,
    add_note,
)

_EARLIEST_NS, _LATEST_NS = -(2**63), 2**63 - 1
_LARGE_BYTES = 64 << 20
_MOST_AT_ONCE, _BYTES_AT_ONCE = 256, 1 << 18  # rows that are fetched while holding the lock
_TOTALS = "count(*)" + "".join(
    f", coalesce(sum({part} & 0xFFFFFFFF), 0)" for part in ("id", "timestamp", "(timestamp >> 32)")
)
"""Which differ where an index has other rows or stamps than the table, or is not in order."""

_ROW = np.dtype([("id", "<i8"), ("stamp_ns", "<i8"), ("topic", "<i8")])

_Rows = npt.NDArray[np.void]


class SqliteFile:
    """One SQLite file of rosbag2; a `Storage` of one piece.

    A file that is whole is read through SQLite's own index of the stamps. Of any other, all rows
    are read that can be: from the first on and from the last back, to where it is damaged.

    Args:
        path: of the file.
        schemas: of its recording.
        loss: where to say what cannot be read.
        label: what begins each note of that, where the recording has more files.
        told: messages of each topic, where that is known. A large file is not counted then when it
            is opened, but when all of it is read.

    Raises:
        OpenError: it cannot be read, or is no file of rosbag2.
    """

    def __init__(
        self,
        path: Path,
        schemas: Schemas,
        loss: Loss,
        label: str = "",
        told: Mapping[str, int] | None = None,
    ) -> None:
        self.path, self._loss, self._label = path, loss, label
        self.size = path.stat().st_size
        self.compressions: Collection[str] = ("none",)
        self._lock = threading.Lock()
        self._is_closed = False
        self._lost: set[int] = set()
        self._rows: _Rows | None = None  # sorted, where SQLite's index does not serve
        self._database = connect(path)
        try:
            self.channels: Mapping[int, Channel] = channels(self._database, schemas)
        except sqlite3.Error as error:
            self.close()
            raise OpenError(
                f"{path}: no ROS 2 bag that can be read: {error}; copy it again"
            ) from None
        self._readable = {
            number: (channel.topic, channel.type_name, channel.definitions)
            for number, channel in self.channels.items()
            if channel.definitions
        }
        self._told: dict[int, int] = {}
        self.counts, spans_ns = self._believed(told or {}) or self._survey()
        self.starts_ns, self.ends_ns = np.array(spans_ns, np.int64).reshape(-1, 2).T
        unknown = sum(n for topic, n in self.counts.items() if topic not in self.channels)
        self._lose(unknown, f"{unknown} messages of topics that it does not name")
        if left := left_beside(path):
            why = f"never finished by its recorder, which left {left} beside it"
            add_note(loss, f"{label}{why}; messages that are there: {sum(self.counts.values())}")

    def select(self, query: Query) -> npt.NDArray[np.intp]:
        is_empty = not self._topics(query) or not len(self.starts_ns)
        return np.arange(0 if is_empty else 1)

    def open_piece(self, piece: int, query: Query, shelf: Shelf) -> Piece:
        return StreamedPiece(self._entries(query))

    def _entries(self, query: Query) -> Iterator[Entry]:
        last = (_EARLIEST_NS, _EARLIEST_NS)
        counts: Counter[int] = Counter()
        try:
            for number, stamp_ns, topic, data in self._ordered(query):
                counts[topic] += 1
                if not isinstance(stamp_ns, int) or (stamp_ns, number) <= last:
                    raise sqlite3.DatabaseError("its index is not in order")
                yield self._entry(topic, stamp_ns, data)
                last = (stamp_ns, number)
            if query.is_ever and not self._is_closed:
                self._compare(counts, self._topics(query))
        except sqlite3.DatabaseError as error:
            self._salvage(error)
        yield from self._salvaged(query, last)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        rows = self._rows if self._rows is not None else self._scan()[0]
        topics, numbers = np.unique(rows["topic"], return_counts=True)
        if not self._is_closed:
            counts = dict(zip(topics.tolist(), numbers.tolist(), strict=True))
            self._compare(counts, list(self._told))
        for topic in topics:
            yield int(topic), rows["stamp_ns"][rows["topic"] == topic]

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        self._is_closed = True
        with suppress(sqlite3.ProgrammingError):  # it is closed already
            self._database.interrupt()
        with self._lock:
            self._database.close()

    def _believed(
        self, told: Mapping[str, int]
    ) -> tuple[Mapping[int, int], list[tuple[int, int]]] | None:
        """What a large file holds, as it is told; the span of its stamps is that of its index."""
        topics = {channel.topic: number for number, channel in self.channels.items()}
        is_all = len(topics) == len(self.channels) and topics.keys() == told.keys()
        if self.size < _LARGE_BYTES or not is_all:
            return None
        try:
            if not self._serves():
                return None
            sql = "SELECT timestamp FROM messages ORDER BY timestamp"
            ends = [next(self._select(f"{sql} {way} LIMIT 1")) for way in ("ASC", "DESC")]
        except (sqlite3.DatabaseError, StopIteration):
            return None
        if not all(isinstance(stamp_ns, int) for (stamp_ns,) in ends):
            return None
        self._told = {topics[name]: count for name, count in told.items()}
        return dict(self._told), [(ends[0][0], ends[1][0])]

    def _compare(self, counts: Mapping[int, int], topics: Collection[int]) -> None:
        """Hold the messages that are there on some topics against those that were told; once."""
        for number in set(topics) & self._told.keys():
            told, found = self._told.pop(number), counts.get(number, 0)
            if found != told:
                self._loss.messages += max(0, told - found)
                topic = self.channels[number].topic
                note = f"{METADATA} counts {told} messages on {topic}, {found} are there"
                add_note(self._loss, note)

    def _survey(self) -> tuple[Mapping[int, int], list[tuple[int, int]]]:
        """Messages of each topic, and the span of their stamps if there are any."""
        try:
            found = self._counted() if self._serves() else None
        except sqlite3.DatabaseError as error:
            rows = self._salvage(error)
        else:
            if found is not None:
                return found
            rows = self._salvage(None)
        topics, numbers = np.unique(rows["topic"], return_counts=True)
        counts = dict(zip(topics.tolist(), numbers.tolist(), strict=True))
        stamps_ns = rows["stamp_ns"]
        return counts, [(int(stamps_ns[0]), int(stamps_ns[-1]))] if len(rows) else []

    def _serves(self) -> bool:
        """True if SQLite can read the file in order of time, and none of its end is missing.

        Raises:
            sqlite3.DatabaseError: the file is damaged.
        """
        [(page,)] = self._select("PRAGMA page_size")
        return has_index(self._database) and not missing_bytes(self.path, page)

    @damage_by_name()
    def _counted(self) -> tuple[Mapping[int, int], list[tuple[int, int]]]:
        """The same by SQLite's own counting.

        Raises:
            sqlite3.DatabaseError: the file is damaged.
        """
        found = self._database.execute(
            f"SELECT topic_id, {_TOTALS}, min(timestamp), max(timestamp)"
            " FROM messages NOT INDEXED GROUP BY topic_id"
        ).fetchall()
        if not all(isinstance(value, int) for row in found for value in row):
            raise sqlite3.DatabaseError("its rows are damaged")
        counts = {row[0]: row[1] for row in found}
        totals = tuple(sum(row[column] for row in found) for column in (1, 2, 3, 4))
        [indexed] = self._database.execute(
            f"SELECT {_TOTALS} FROM messages WHERE timestamp >= ? AND timestamp < ?",
            (_EARLIEST_NS, _LATEST_NS),
        )
        if indexed != totals:
            raise sqlite3.DatabaseError("its index is not that of its messages")
        return counts, [(min(r[-2] for r in found), max(r[-1] for r in found))] if found else []

    def _ordered(self, query: Query) -> Iterator[Any]:
        """What is asked for, by SQLite's index; nothing where that does not serve."""
        if self._rows is not None:
            return iter(())
        topics = self._topics(query)
        message_bytes = self.size // max(1, sum(self.counts.values()))
        return self._select(
            "SELECT id, timestamp, topic_id, data FROM messages"
            f" WHERE timestamp >= ? AND timestamp < ? AND topic_id IN ({_marks(topics)})"
            " ORDER BY timestamp, id",
            (max(query.start_ns, _EARLIEST_NS), min(query.stop_ns, _LATEST_NS), *topics),
            at_once=min(_MOST_AT_ONCE, 1 + _BYTES_AT_ONCE // max(1, message_bytes)),
        )

    def _salvaged(self, query: Query, last: tuple[int, int]) -> Iterator[Entry]:
        """What is asked for after a stamp and row, by the rows that were found one by one."""
        if self._rows is None:
            return
        rows = self._rows[np.isin(self._rows["topic"], self._topics(query))]
        stamps_ns = rows["stamp_ns"]
        first = np.searchsorted(stamps_ns, min(max(query.start_ns, last[0]), _LATEST_NS))
        stop = np.searchsorted(stamps_ns, max(min(query.stop_ns, _LATEST_NS), _EARLIEST_NS))
        for number, stamp_ns, topic in rows[first:stop].tolist():
            if (stamp_ns, number) <= last:
                continue
            data = self._data(number)
            if self._is_closed:
                return
            if data is not None:
                yield self._entry(topic, stamp_ns, data)
            elif number not in self._lost:
                self._lost.add(number)
                self._lose(1, "messages whose bytes are damaged")

    def _select(self, sql: str, values: Collection[int] = (), at_once: int = 1) -> Iterator[Any]:
        """Rows one by one; they end when the file is closed."""
        cursor = None
        rows = [()]
        while rows:
            with self._lock:
                if self._is_closed:
                    return
                try:
                    with damage_by_name():
                        cursor = cursor or self._database.execute(sql, tuple(values))
                        rows = cursor.fetchmany(at_once)
                except sqlite3.OperationalError:
                    if self._is_closed:
                        return
                    raise
            yield from rows

    def _salvage(self, error: sqlite3.Error | None) -> _Rows:
        """Find the rows one by one from now on, instead of by SQLite's index."""
        if self._rows is not None:
            return self._rows
        found, gap, is_whole = self._scan()
        rows, missing = self._without_cut(found)
        self._rows = rows[np.lexsort((rows["id"], rows["stamp_ns"]))]
        self._loss.messages += gap + len(found) - len(rows)
        self._loss.bytes += missing
        if error is not None or missing or not is_whole:
            why = error or "its end is missing"
            add_note(self._loss, f"{self._label}cut off or damaged, read where it can be: {why}")
        return self._rows

    def _without_cut(self, rows: _Rows) -> tuple[_Rows, int]:
        """Rows without those that SQLite fills up with zeros, where the file ends in a page.

        Also how many bytes are missing there.
        """
        [(page,)] = self._select("PRAGMA page_size")
        missing = missing_bytes(self.path, page)
        if self.size % page == 0:
            return rows, missing
        cut = cut_rows(self.path, page)
        for number in rows["id"][::-1].tolist() if not cut else ():
            data = self._data(number)
            if data is not None and is_spilled(len(data), page):
                cut = {number} if data.endswith(b"\0") else set()
                break
        is_cut = np.isin(rows["id"], list(cut))
        return rows[~is_cut], missing

    def _lose(self, messages: int, why: str) -> None:
        if messages:
            self._loss.messages += messages
            add_note(self._loss, f"{self._label}{why}")

    def _data(self, number: int) -> bytes | None:
        """The bytes of a message; None where they are damaged, or the file is closed."""
        try:
            found = list(self._select("SELECT data FROM messages WHERE id = ?", (number,)))
        except sqlite3.DatabaseError:
            return None
        return found[0][0] if found and isinstance(found[0][0], bytes) else None

    def _scan(self) -> tuple[_Rows, int, bool]:
        """All rows that can be found, how many lie between that cannot, and if all was read."""
        sql = "SELECT id, timestamp, topic_id FROM messages NOT INDEXED"
        rows, is_whole = self._fetch(f"{sql} ORDER BY id")
        if is_whole:
            return rows, 0, True
        after = int(rows["id"][-1]) if len(rows) else 0
        tail, _ = self._fetch(f"{sql} WHERE id > {after} ORDER BY id DESC")
        gap = int(tail["id"][-1]) - after - 1 if len(tail) else 0
        return np.concatenate([rows, tail[::-1]]), gap, False

    def _fetch(self, sql: str) -> tuple[_Rows, bool]:
        """Rows until the file's end or damage; whether it was the end."""
        found: list[tuple[int, int, int]] = []
        try:
            found.extend(row for row in self._select(sql) if set(map(type, row)) == {int})
        except sqlite3.DatabaseError:
            return np.array(found, _ROW), False
        return np.array(found, _ROW), True

    def _entry(self, topic: int, stamp_ns: int, data: Any) -> Entry:
        name, type_name, definitions = self._readable[topic]
        data = data if isinstance(data, bytes) else b""
        return Entry(name, stamp_ns, Recorded(type_name, data, definitions, stamp_ns))

    def _topics(self, query: Query) -> list[int]:
        return [number for number, channel in self.channels.items() if query.asks_for(channel)]


def _marks(values: Collection[int]) -> str:
    return ",".join("?" * len(values))
