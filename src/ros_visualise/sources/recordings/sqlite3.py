"""SQLite files of rosbag2: whole, cut off or damaged in places."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ros_visualise.errors import DamagedMessage, OpenError
from ros_visualise.messages.recorded import Recorded
from ros_visualise.sources.recordings import Entry, Loss
from ros_visualise.sources.recordings.schemas import Schemas, digest, is_latched, ros_name
from ros_visualise.sources.recordings.storage import Channel, Query, add_note

_EARLIEST_NS, _LATEST_NS = -(2**63), 2**63 - 1
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

    Raises:
        OpenError: it cannot be read, or is no file of rosbag2.
    """

    def __init__(self, path: Path, schemas: Schemas, loss: Loss) -> None:
        self.path, self._loss = path, loss
        self.size = path.stat().st_size
        self.compressions: Collection[str] = ("none",)
        self._lock = threading.Lock()
        self._is_closed = False
        self._lost: set[int] = set()
        self._rows: _Rows | None = None  # sorted, where SQLite's index does not serve
        self._database = _connect(path)
        try:
            self.channels: Mapping[int, Channel] = _channels(self._database, schemas)
        except sqlite3.Error as error:
            self.close()
            raise OpenError(f"{path}: no ROS 2 bag that can be read: {error}") from None
        self.counts, spans_ns = self._survey()
        self.starts_ns, self.ends_ns = np.array(spans_ns, np.int64).reshape(-1, 2).T
        unknown = sum(n for topic, n in self.counts.items() if topic not in self.channels)
        if unknown:
            loss.messages += unknown
            add_note(loss, f"{path.name}: {unknown} messages of topics that it does not name")

    def select(self, query: Query) -> npt.NDArray[np.intp]:
        """As `Storage.select`."""
        is_empty = not self._topics(query) or not len(self.starts_ns)
        return np.arange(0 if is_empty else 1)

    def read_piece(self, piece: int, query: Query) -> Iterator[Entry]:
        """As `Storage.read_piece`."""
        last = (_EARLIEST_NS, _EARLIEST_NS)
        try:
            for number, stamp_ns, topic, data in self._ordered(query):
                last = (stamp_ns, number)
                yield self._entry(topic, stamp_ns, data)
        except sqlite3.DatabaseError as error:
            self._salvage(error)
        yield from self._salvaged(query, last)

    def stamps_ns(self) -> Iterator[tuple[int, npt.NDArray[np.int64]]]:
        """As `Storage.stamps_ns`."""
        rows = self._rows if self._rows is not None else self._scan()[0]
        for topic in np.unique(rows["topic"]):
            yield int(topic), rows["stamp_ns"][rows["topic"] == topic]

    def close(self) -> None:
        """As `Storage.close`."""
        self._is_closed = True
        with suppress(sqlite3.ProgrammingError):  # it is closed already
            self._database.interrupt()
        with self._lock:
            self._database.close()

    def _survey(self) -> tuple[Mapping[int, int], list[tuple[int, int]]]:
        """Messages of each topic, and the span of their stamps if there are any."""
        try:
            if _has_index(self._database):
                found = self._database.execute(
                    "SELECT topic_id, count(*), min(timestamp), max(timestamp)"
                    " FROM messages GROUP BY topic_id"
                ).fetchall()
                counts = {topic: count for topic, count, _, _ in found}
                return counts, [(min(r[2] for r in found), max(r[3] for r in found))] * bool(found)
            rows = self._salvage(None)
        except sqlite3.DatabaseError as error:
            rows = self._salvage(error)
        topics, numbers = np.unique(rows["topic"], return_counts=True)
        counts = dict(zip(topics.tolist(), numbers.tolist(), strict=True))
        stamps_ns = rows["stamp_ns"]
        return counts, [(int(stamps_ns[0]), int(stamps_ns[-1]))] * bool(len(rows))

    def _ordered(self, query: Query) -> Iterator[tuple[int, int, int, Any]]:
        """What is asked for, by SQLite's index; nothing where that does not serve."""
        if self._rows is not None:
            return
        topics = self._topics(query)
        yield from self._select(
            "SELECT id, timestamp, topic_id, data FROM messages"
            f" WHERE timestamp >= ? AND timestamp < ? AND topic_id IN ({_marks(topics)})"
            " ORDER BY timestamp, id",
            (max(query.start_ns, _EARLIEST_NS), min(query.stop_ns, _LATEST_NS), *topics),
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
            try:
                found = list(self._select("SELECT data FROM messages WHERE id = ?", (number,)))
            except sqlite3.DatabaseError:
                found = []
            if self._is_closed:
                return
            if found:
                yield self._entry(topic, stamp_ns, found[0][0])
            elif number not in self._lost:
                self._lost.add(number)
                self._loss.messages += 1

    def _select(self, sql: str, values: Collection[int] = ()) -> Iterator[Any]:
        """Rows one by one; they end when the file is closed."""
        cursor = None
        while True:
            with self._lock:
                if self._is_closed:
                    return
                try:
                    cursor = cursor or self._database.execute(sql, tuple(values))
                    row = cursor.fetchone()
                except sqlite3.OperationalError:
                    if self._is_closed:
                        return
                    raise
            if row is None:
                return
            yield row

    def _salvage(self, error: sqlite3.Error | None) -> _Rows:
        """Find the rows one by one from now on, instead of by SQLite's index."""
        rows, gap = self._scan()
        self._rows = rows[np.lexsort((rows["id"], rows["stamp_ns"]))]
        self._loss.messages += gap
        if error is not None:
            add_note(
                self._loss, f"{self.path.name}: cut off or damaged, read where it can be: {error}"
            )
        return self._rows

    def _scan(self) -> tuple[_Rows, int]:
        """All rows that can be found, and how many lie between those that cannot."""
        sql = "SELECT id, timestamp, topic_id FROM messages NOT INDEXED"
        rows, is_whole = self._fetch(f"{sql} ORDER BY id")
        if is_whole:
            return rows, 0
        after = int(rows["id"][-1]) if len(rows) else 0
        tail, _ = self._fetch(f"{sql} WHERE id > {after} ORDER BY id DESC")
        gap = int(tail["id"][-1]) - after - 1 if len(tail) else 0
        return np.concatenate([rows, tail[::-1]]), gap

    def _fetch(self, sql: str) -> tuple[_Rows, bool]:
        """Rows until the file's end or damage; whether it was the end."""
        found: list[tuple[int, int, int]] = []
        try:
            found.extend(row for row in self._select(sql) if set(map(type, row)) == {int})
        except sqlite3.DatabaseError:
            return np.array(found, _ROW), False
        return np.array(found, _ROW), True

    def _entry(self, topic: int, stamp_ns: int, data: Any) -> Entry:
        channel = self.channels[topic]
        assert channel.definitions is not None
        data = data if isinstance(data, bytes) else b""
        message = Recorded(channel.type_name, data, channel.definitions, stamp_ns)
        return Entry(channel.topic, stamp_ns, message)

    def _topics(self, query: Query) -> list[int]:
        return [number for number, channel in self.channels.items() if query.asks_for(channel)]


def _connect(path: Path) -> sqlite3.Connection:
    """The database, not to be changed; with what a writer left beside it if it was killed."""
    left = path.with_name(f"{path.name}-wal")
    is_left = left.is_file() and left.stat().st_size > 0
    for mode in ("mode=ro",) * is_left + ("mode=ro&immutable=1",):
        database = sqlite3.connect(
            f"{path.absolute().as_uri()}?{mode}", uri=True, check_same_thread=False
        )
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        try:
            database.execute("SELECT count(*) FROM sqlite_master")
        except sqlite3.Error as error:
            database.close()
            reason = error
        else:
            return database
    raise OpenError(f"{path}: no ROS 2 bag that can be read: {reason}; copy it again")


def _channels(database: sqlite3.Connection, schemas: Schemas) -> dict[int, Channel]:
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master")}
    if not {"messages", "topics"} <= tables:
        raise sqlite3.DatabaseError("it has no tables of messages and topics")
    definitions: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        definitions = {
            name: (encoding, text)
            for name, encoding, text in database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
        }
    cursor = database.execute("SELECT * FROM topics ORDER BY id")
    names = [column[0] for column in cursor.description]
    topics = [dict(zip(names, row, strict=True)) for row in cursor]
    return {topic["id"]: _channel(topic, definitions, schemas) for topic in topics}


def _channel(
    topic: Mapping[str, Any], definitions: Mapping[str, tuple[str, str]], schemas: Schemas
) -> Channel:
    name, type_name = str(topic["name"]), ros_name(str(topic["type"]))
    encoding = topic.get("serialization_format") or "cdr"
    if encoding != "cdr":
        return Channel(name, type_name, unreadable=f"{encoding}: only ROS messages are read")
    language, text = definitions.get(type_name, ("", ""))
    try:
        known = schemas.define("cdr", type_name, text, is_idl=language == "ros2idl")
    except DamagedMessage as damage:
        return Channel(name, type_name, unreadable=str(damage))
    given = topic.get("type_description_hash") or digest(known, type_name)
    return Channel(
        name, type_name, known, given, is_latched(str(topic.get("offered_qos_profiles", "")))
    )


def _has_index(database: sqlite3.Connection) -> bool:
    """Whether SQLite can give the messages in order of time without sorting them."""
    plan = database.execute(
        "EXPLAIN QUERY PLAN SELECT data FROM messages ORDER BY timestamp, id"
    ).fetchall()
    return not any("TEMP B-TREE" in str(step[-1]) for step in plan)


def _marks(values: Collection[int]) -> str:
    return ",".join("?" * len(values))
