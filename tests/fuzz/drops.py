"""Inputs that lack one whole record, while nothing else is changed."""

import random
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import made_bags

Span = tuple[int, int]
_MCAP_HEAD, _ULOG_HEAD = struct.Struct("<BQ"), struct.Struct("<HB")
_BAG_INDEX, _BAG_CHUNK = 4, 5


def drop(whole: Path, target: Path, rng: random.Random) -> bool:
    """A copy of a file without one of its records; whether its format has any."""
    how = _HOW.get(whole.suffix.lower())
    if how is None:
        return False
    target.write_bytes(whole.read_bytes())
    how(target, rng)
    return True


def _cut(spans: Callable[[bytes], list[Span]]) -> Callable[[Path, random.Random], None]:
    def drop_one(path: Path, rng: random.Random) -> None:
        data = path.read_bytes()
        start, end = rng.choice(spans(data) or [(0, 0)])
        path.write_bytes(data[:start] + data[end:])

    return drop_one


def _bag(data: bytes) -> list[Span]:
    """Its records; a chunk with the index records behind it as often as each by itself."""
    records = made_bags.pieces(data)
    spans = [(one.start, one.end) for one in records[1:]]
    for place, one in enumerate(records):
        if one.op == _BAG_CHUNK:
            last = place
            while last + 1 < len(records) and records[last + 1].op == _BAG_INDEX:
                last += 1
            spans.append((one.start, records[last].end))
    kinds = {one.start: one.op for one in records}
    rare = [span for span in spans if kinds[span[0]] != _BAG_INDEX]
    return rare * 3 + spans


def _mcap(data: bytes) -> list[Span]:
    return _walk(data, len(b"\x89MCAP0\r\n"), lambda at: _mcap_end(data, at))


def _mcap_end(data: bytes, at: int) -> int:
    return at + _MCAP_HEAD.size + int(_MCAP_HEAD.unpack_from(data, at)[1])


def _ulog(data: bytes) -> list[Span]:
    return _walk(data, 16, lambda at: at + _ULOG_HEAD.size + _ULOG_HEAD.unpack_from(data, at)[0])


def _walk(data: bytes, start: int, end_of: Callable[[int], int]) -> list[Span]:
    spans = []
    while start + _MCAP_HEAD.size < len(data):
        end = end_of(start)
        if end > len(data):
            break
        spans.append((start, end))
        start = end
    return spans


def _lines(data: bytes) -> list[Span]:
    ends = [place + 1 for place, byte in enumerate(data) if byte == ord("\n")]
    return list(zip([0, *ends], ends, strict=False))


def _row(path: Path, rng: random.Random) -> None:
    with closing(sqlite3.connect(path)) as base:
        found = base.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        table = rng.choice(sorted(name for (name,) in found if not name.startswith("sqlite")))
        rows = [row for (row,) in base.execute(f"SELECT rowid FROM {table}")]
        if rows:
            base.execute(f"DELETE FROM {table} WHERE rowid = ?", (rng.choice(rows),))
        base.commit()


_HOW: dict[str, Callable[[Path, random.Random], None]] = {
    ".bag": _cut(_bag),
    ".mcap": _cut(_mcap),
    ".ulg": _cut(_ulog),
    ".db3": _row,
    ".srt": _cut(_lines),
    ".yaml": _cut(_lines),
    ".txt": _cut(_lines),
}
