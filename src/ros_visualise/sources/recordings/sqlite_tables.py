"""The tables of rosbag2's SQLite files in all their versions, and the ends of files that are cut.

SQLite itself fills up a page that is cut with zeros, without a word.

Source: "Database File Format", sqlite.org/fileformat2.html, sections 1.3, 1.6 and 2.
"""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.sources.recordings.schemas import Schemas, is_latched, ros_name
from ros_visualise.sources.recordings.storage import Channel

_NAMES = ("messages", "topics", "message_definitions")
_VIRTUAL = re.compile(r"\s*CREATE\s+VIRTUAL", re.IGNORECASE)
_PAGE_COUNT_AT = 28
_LEAF = 13
_OVERFLOW_LINK_BYTES = 4
_CELLS = struct.Struct(">xxxH")
_CELLS_START = 8


@contextmanager
def damage_by_name() -> Iterator[None]:
    """Turn all that Python raises on a damaged file into `sqlite3.DatabaseError`."""
    try:
        yield
    except MemoryError:  # a length of as much as there never was
        raise sqlite3.DatabaseError("an impossible length") from None
    except UnicodeDecodeError:  # in SQLite's own message of what is wrong
        raise sqlite3.DatabaseError("unreadable names") from None


def connect(path: Path) -> sqlite3.Connection:
    """Open a database read-only, with the files that a killed writer left; raises OpenError."""
    modes = ["mode=ro&immutable=1"] * 2
    if left_beside(path).endswith("-wal"):
        modes.insert(0, "mode=ro")
    for attempt, mode in enumerate(modes, 1):
        database = sqlite3.connect(
            f"{path.absolute().as_uri()}?{mode}", uri=True, check_same_thread=False
        )
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        if attempt == len(modes):  # SQLite then also reads a file that is shorter than it says
            database.execute("PRAGMA writable_schema = ON")
        try:
            with damage_by_name():
                database.execute("SELECT count(*) FROM sqlite_master")
        except sqlite3.Error as error:
            database.close()
            reason = error
        else:
            return database
    raise OpenError(f"{path}: unreadable ROS 2 bag: {reason}; copy it again")


def left_beside(path: Path) -> str:
    """Name of the file beside a database whose writer was killed; empty without one.

    Source: "Temporary Files Used By SQLite", sqlite.org/tempfiles.html, sections 2.1 and 2.2.
    """
    for kind in ("wal", "journal"):
        file = path.with_name(f"{path.name}-{kind}")
        with suppress(OSError), open_file(file) as journal:
            if any(journal.read(8)):  # zeros are what some writers leave when they are done
                return file.name
    return ""


@damage_by_name()
def channels(database: sqlite3.Connection, schemas: Schemas) -> dict[int, Channel]:
    """The topics of a bag, by their numbers; raises DatabaseError."""
    tables = {name for name in _NAMES if _is_table(database, name)}
    if not {"messages", "topics"} <= tables:
        raise sqlite3.DatabaseError("the table 'messages' or 'topics' is missing")
    definitions = _definitions(database) if "message_definitions" in tables else {}
    cursor = database.execute("SELECT * FROM topics ORDER BY id")
    names = [column[0] for column in cursor.description]
    topics = [dict(zip(names, row, strict=True)) for row in cursor]
    return {topic["id"]: _channel(topic, definitions, schemas) for topic in topics}


def _definitions(database: sqlite3.Connection) -> dict[str, tuple[str, str]]:
    """Language and text of each type; of a damaged table, as far as it can be read."""
    sql = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
    found: dict[str, tuple[str, str]] = {}
    with suppress(sqlite3.DatabaseError), damage_by_name():  # ROS's own need none
        for name, language, text in database.execute(sql):
            found[str(name)] = str(language), str(text)
    return found


def _channel(
    topic: Mapping[str, Any], definitions: Mapping[str, tuple[str, str]], schemas: Schemas
) -> Channel:
    name, type_name = str(topic["name"]), ros_name(str(topic["type"]))
    encoding = topic.get("serialization_format") or "cdr"
    if encoding != "cdr":
        return Channel(name, type_name, unreadable=f"{encoding}: only ROS messages are supported")
    language, text = definitions.get(type_name, ("", ""))
    given = str(topic.get("type_description_hash") or "")
    qos = str(topic.get("offered_qos_profiles") or "")
    found = Channel(name, type_name, latched=is_latched(qos), offered_qos=qos)
    return schemas.complete(found, "cdr", text, given, language == "ros2idl")


def _is_table(database: sqlite3.Connection, name: str) -> bool:
    """True if a table exists and all its values are stored; computed ones may be endless."""
    found = database.execute(
        "SELECT type, sql FROM sqlite_master WHERE name = ?", (name,)
    ).fetchall()
    is_stored = [kind == "table" and not _VIRTUAL.match(str(sql)) for kind, sql in found]
    columns = database.execute(f"PRAGMA table_xinfo({name})")
    return is_stored == [True] and not any(column[-1] for column in columns)


@damage_by_name()
def has_index(database: sqlite3.Connection) -> bool:
    """True if SQLite can read the messages in order of time without sorting them."""
    plan = database.execute(
        "EXPLAIN QUERY PLAN SELECT data FROM messages ORDER BY timestamp, id"
    ).fetchall()
    return not any("TEMP B-TREE" in str(step[-1]) for step in plan)


def missing_bytes(path: Path, page_bytes: int) -> int:
    """Bytes by which a file is shorter than its header declares."""
    with open_file(path) as file:
        file.seek(_PAGE_COUNT_AT)
        pages = int.from_bytes(file.read(4), "big")
    return max(0, pages * page_bytes - path.stat().st_size)


def cut_rows(path: Path, page_bytes: int) -> set[int]:
    """The rows that are cut off at the end of the file, on its last page of rows."""
    size = path.stat().st_size
    with open_file(path) as file:
        file.seek(size - size % page_bytes)
        page = file.read()
    if len(page) < _CELLS_START or page[0] != _LEAF:
        return set()
    (count,) = _CELLS.unpack_from(page)
    rows = set()
    for cell in range(_CELLS_START, min(_CELLS_START + 2 * count, len(page) - 1), 2):
        place = int.from_bytes(page[cell : cell + 2], "big")
        payload, at = _varint(page, place)
        row, at = _varint(page, at)
        if at + _bytes_on_page(payload, page_bytes) > len(page):
            rows.add(row)
    return rows


def is_spilled(payload_bytes: int, page_bytes: int) -> bool:
    """True if a row continues on pages of its own."""
    return payload_bytes > page_bytes - 35


def _bytes_on_page(payload_bytes: int, page_bytes: int) -> int:
    if not is_spilled(payload_bytes, page_bytes):
        return payload_bytes
    least = (page_bytes - 12) * 32 // 255 - 23
    kept = least + (payload_bytes - least) % (page_bytes - _OVERFLOW_LINK_BYTES)
    return (least if is_spilled(kept, page_bytes) else kept) + _OVERFLOW_LINK_BYTES


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A number in seven bits a byte, and where it ends."""
    value = 0
    for byte in data[at : at + 9]:
        value = value << 7 | byte & 0x7F
        at += 1
        if byte < 0x80:
            break
    return value, at
