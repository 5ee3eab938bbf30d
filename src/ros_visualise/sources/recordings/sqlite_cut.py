"""Where a SQLite file ends within a page, which SQLite itself fills up with zeros unseen.

Source: "Database File Format", sqlite.org/fileformat2.html, sections 1.3, 1.6 and 2.
"""

from __future__ import annotations

import struct
from pathlib import Path

from ros_visualise.core.regular_files import open_file

_PAGE_COUNT_AT = 28
_LEAF = 13
_OVERFLOW_LINK_BYTES = 4
_CELLS = struct.Struct(">xxxH")
_CELLS_START = 8


def missing_bytes(path: Path, page_bytes: int) -> int:
    """How much shorter a file is than its own header says."""
    with open_file(path) as file:
        file.seek(_PAGE_COUNT_AT)
        pages = int.from_bytes(file.read(4), "big")
    return max(0, pages * page_bytes - path.stat().st_size)


def cut_rows(path: Path, page_bytes: int) -> set[int]:
    """The rows whose bytes the end of the file cuts, on the page of rows that it cuts."""
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
    """Whether a row goes on on pages of its own."""
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
