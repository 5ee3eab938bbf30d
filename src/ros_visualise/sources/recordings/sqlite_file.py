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
from ros_visualise.sources.recordings import Entry, Extra, PartialLoss
from ros_visualise.sources.recordings.metadata import METADATA
from ros_visualise.sources.recordings.pieces import PieceCache
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
from ros_visualise.sources.recordings.storage import Channel, MessageQuery, Piece, StreamedPiece

_EARLIEST_NS, _LATEST_NS = -(2**63), 2**63 - 1
_LARGE_BYTES = 64 << 20
_MOST_AT_ONCE, _BYTES_AT_ONCE = 256, 1 << 18  # rows that are fetched while holding the lock
_TOTALS = "count(*)" + "".join(
    f", coalesce(sum({part} & 0xFFFFFFFF), 0)" for part in ("id", "timestamp", "(timestamp >> 32)")
)
"""Totals that differ if an index has other rows or stamps than the table, or is not in order."""

_ROW = np.dtype([("id", "<i8"), ("stamp_ns", "<i8"), ("topic", "<i8")])

_Rows = npt.NDArray[np.void]


class SqliteFile:
    """One SQLite file of rosbag2; a `Storage` of one piece.

    A whole file is read through SQLite's own index of the stamps. Of any other, all readable rows
    are read: from the first on and from the last back, to the damage. If the messages of each topic
    are ``declared``, a large file is counted not when it is opened, but when all of it is read.
    Raises OpenError.
    """

    def __init__(
        self,
        path: Path,
        schemas: Schemas,
        loss: PartialLoss,
        declared: Mapping[str, int] | None = None,
    ) -> None:
        self.path, self._loss = path, loss
        self.size = path.stat().st_size
        self.compressions: Collection[str] = ("none",)
        self._lock = threading.Lock()
        self._is_closed = False
        self._lost: set[int] = set()
        self._rows: _Rows | None = None  # sorted; None while SQLite's index is usable
        self._database = connect(path)
        try:
            self.channels: Mapping[int, Channel] = channels(self._database, schemas)
        except sqlite3.Error as error:
            self.close()
            raise OpenError(f"{path}: unreadable ROS 2 bag: {error}; copy it again") from None
        self._readable = MessageQuery().readable(self.channels)
        self._declared: dict[int, int] = {}
        self.counts, spans_ns = self._believed(declared or {}) or self._survey()
        self.starts_ns, self.ends_ns = np.array(spans_ns, np.int64).reshape(-1, 2).T
        unknown = sum(n for topic, n in self.counts.items() if topic not in self.channels)
        if unknown:
            loss.add(f"{unknown} messages on topics without a description", unknown)
        if left := left_beside(path):
            why = f"never finished by its recorder, which left {left} beside it"
            loss.add(f"{why}; messages found: {sum(self.counts.values())}")

    def select(self, query: MessageQuery) -> npt.NDArray[np.intp]:
        return np.arange(int(bool(query.readable(self.channels)) and len(self.starts_ns) > 0))

    def open_piece(self, piece: int, query: MessageQuery, cache: PieceCache) -> Piece:
        return StreamedPiece(self._entries(query))

    def _entries(self, query: MessageQuery) -> Iterator[Entry]:
        last = (_EARLIEST_NS, _EARLIEST_NS)
        counts: Counter[int] = Counter()
        try:
            for number, stamp_ns, topic, data in self._ordered(query):
                counts[topic] += 1
                if not isinstance(stamp_ns, int) or (stamp_ns, number) <= last:
                    raise sqlite3.DatabaseError("its index is not sorted by time")
                yield self._entry(topic, stamp_ns, data)
                last = (stamp_ns, number)
            if query.is_ever and not self._is_closed:
                self._compare(counts, list(query.readable(self.channels)))
        except sqlite3.DatabaseError as error:
            self._salvage(error)
        yield from self._salvaged(query, last)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        rows = self._rows if self._rows is not None else self._scan()[0]
        topics, numbers = np.unique(rows["topic"], return_counts=True)
        if not self._is_closed:
            counts = dict(zip(topics.tolist(), numbers.tolist(), strict=True))
            self._compare(counts, list(self._declared))
        for topic in topics:
            yield int(topic), rows["stamp_ns"][rows["topic"] == topic]

    def extras(self) -> Iterator[Extra]:
        return iter(())

    def close(self) -> None:
        self._is_closed = True
        with suppress(sqlite3.ProgrammingError):  # already closed
            self._database.interrupt()
        with self._lock:
            self._database.close()

    def _believed(
        self, declared: Mapping[str, int]
    ) -> tuple[Mapping[int, int], list[tuple[int, int]]] | None:
        """The declared counts of a large file, and the span of stamps in its index."""
        topics = {channel.topic: number for number, channel in self.channels.items()}
        is_all = len(topics) == len(self.channels) and topics.keys() == declared.keys()
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
        self._declared = {topics[name]: count for name, count in declared.items()}
        return dict(self._declared), [(ends[0][0], ends[1][0])]

    def _compare(self, counts: Mapping[int, int], topics: Collection[int]) -> None:
        """Compare the messages of some topics with those that were declared; once each."""
        for number in set(topics) & self._declared.keys():
            declared, found = self._declared.pop(number), counts.get(number, 0)
            if found != declared:
                topic = self.channels[number].topic
                note = f"{METADATA} lists {declared} messages on {topic}; found {found}"
                self._loss.whole.add(note, max(0, declared - found))

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
        """True if SQLite can read the whole file in order of time; raises DatabaseError."""
        [(page,)] = self._select("PRAGMA page_size")
        return has_index(self._database) and not missing_bytes(self.path, page)

    @damage_by_name()
    def _counted(self) -> tuple[Mapping[int, int], list[tuple[int, int]]]:
        """Counts and span by SQLite itself; raises DatabaseError if the file is damaged."""
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
            raise sqlite3.DatabaseError("its index does not match its messages")
        return counts, [(min(r[-2] for r in found), max(r[-1] for r in found))] if found else []

    def _ordered(self, query: MessageQuery) -> Iterator[Any]:
        """The selected rows, by SQLite's index; none if that is unusable."""
        if self._rows is not None:
            return iter(())
        topics = list(query.readable(self.channels))
        message_bytes = self.size // max(1, sum(self.counts.values()))
        return self._select(
            "SELECT id, timestamp, topic_id, data FROM messages"
            " WHERE timestamp >= ? AND timestamp < ?"
            f" AND topic_id IN ({','.join('?' * len(topics))}) ORDER BY timestamp, id",
            (max(query.start_ns, _EARLIEST_NS), min(query.stop_ns, _LATEST_NS), *topics),
            at_once=min(_MOST_AT_ONCE, 1 + _BYTES_AT_ONCE // max(1, message_bytes)),
        )

    def _salvaged(self, query: MessageQuery, last: tuple[int, int]) -> Iterator[Entry]:
        """The selected messages after a stamp and row, by the rows that were found one by one."""
        if self._rows is None:
            return
        rows = self._rows[np.isin(self._rows["topic"], list(query.readable(self.channels)))]
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
                self._loss.add("messages whose bytes are damaged", 1)

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
        self._loss.add("", gap + len(found) - len(rows), missing)
        if error is not None or missing or not is_whole:
            why = error or "its end is missing"
            self._loss.add(f"cut off or damaged, read as far as possible: {why}")
        return self._rows

    def _without_cut(self, rows: _Rows) -> tuple[_Rows, int]:
        """Rows without those that SQLite fills up with zeros, if the file ends within a page.

        Also the number of missing bytes.
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

    def _data(self, number: int) -> bytes | None:
        """The bytes of a message; None if they are damaged, or the file is closed."""
        try:
            found = list(self._select("SELECT data FROM messages WHERE id = ?", (number,)))
        except sqlite3.DatabaseError:
            return None
        return found[0][0] if found and isinstance(found[0][0], bytes) else None

    def _scan(self) -> tuple[_Rows, int, bool]:
        """All readable rows, the number of rows lost between them, and true if all was read."""
        sql = "SELECT id, timestamp, topic_id FROM messages NOT INDEXED"
        rows, is_whole = self._fetch(f"{sql} ORDER BY id")
        if is_whole:
            return rows, 0, True
        after = int(rows["id"][-1]) if len(rows) else 0
        tail, _ = self._fetch(f"{sql} WHERE id > {after} ORDER BY id DESC")
        gap = int(tail["id"][-1]) - after - 1 if len(tail) else 0
        return np.concatenate([rows, tail[::-1]]), gap, False

    def _fetch(self, sql: str) -> tuple[_Rows, bool]:
        """Rows until the file's end or damage; true if it was the end."""
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
