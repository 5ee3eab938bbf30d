"""GPMF, in which GoPro's cameras and drones write what their sensors measure, beside the film.

Source: GoPro, GPMF Introduction (gopro/gpmf-parser): KLV triplets, TYPE, SCAL; GPS5 and GPS9.
"""

from __future__ import annotations

import struct
from collections.abc import Container, Iterator
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats

_HEAD = 8
_DEEPEST = 8
_NESTED = 0
_NUMBERS = {
    **{"b": "i1", "B": "u1", "s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4"},
    **{"j": ">i8", "J": ">u8", "f": ">f4", "d": ">f8"},
}
"""GPMF's types -> those of numpy; all are big-endian."""


class Samples(NamedTuple):
    """What one stream holds of one packet: ``values`` (N, fields), in the units that it says.

    ``fix`` is what GPSF says of all: 0 none, 2 or 3 dimensions; -1 where it says nothing.
    """

    key: str
    values: Floats
    fix: int


class _Item(NamedTuple):
    key: str
    kind: int
    size: int
    repeat: int
    data: bytes


def read_samples(packet: bytes, keys: Container[str]) -> Iterator[Samples]:
    """The samples of some streams in a packet; what cannot be read of it is left out."""
    for stream in _streams(packet, 0):
        items = {item.key: item for item in stream}
        last = stream[-1] if stream else None
        if last is None or last.key not in keys:
            continue
        values = _values(last, items)
        if values is not None:
            yield Samples(last.key, values, _fix(items))


def is_whole(packet: bytes, keys: Container[str]) -> bool:
    """Whether a packet can be read to its end, and the samples of some streams in it."""
    return _is_filled(packet, 0) and all(
        _values(stream[-1], {item.key: item for item in stream}) is not None
        for stream in _streams(packet, 0)
        if stream and stream[-1].key in keys and stream[-1].repeat
    )


def _is_filled(data: bytes, depth: int) -> bool:
    """Whether items fill all of it, but for zeros at its end."""
    end = 0
    for item in _items(data):
        if not item.key.isprintable():
            break
        is_nested = item.kind == _NESTED and depth <= _DEEPEST
        if is_nested and not _is_filled(item.data, depth + 1):
            return False
        end += _HEAD + len(item.data) + -len(item.data) % 4
    return not any(data[end:])


def _streams(data: bytes, depth: int) -> Iterator[list[_Item]]:
    for item in _items(data):
        if item.kind != _NESTED or depth > _DEEPEST:
            continue
        if item.key == "STRM":
            yield list(_items(item.data))
        else:
            yield from _streams(item.data, depth + 1)


def _items(data: bytes) -> Iterator[_Item]:
    place = 0
    while place + _HEAD <= len(data):
        key, kind, size, repeat = struct.unpack_from(">4sBBH", data, place)
        place += _HEAD
        end = place + size * repeat
        if end > len(data):
            return
        yield _Item(key.decode("latin-1"), kind, size, repeat, data[place:end])
        place = end + -(size * repeat) % 4


def _values(item: _Item, items: dict[str, _Item]) -> Floats | None:
    """(N, fields) of the last item of a stream, in its units."""
    letters = chr(item.kind)
    if letters == "?":
        letters = items["TYPE"].data.decode("latin-1").rstrip("\0") if "TYPE" in items else ""
    elif letters in _NUMBERS:
        letters *= item.size // np.dtype(_NUMBERS[letters]).itemsize
    if not letters or any(letter not in _NUMBERS for letter in letters):
        return None
    row = np.dtype([(f"f{n}", _NUMBERS[letter]) for n, letter in enumerate(letters)])
    if row.itemsize != item.size or not item.repeat:
        return None
    table = np.frombuffer(item.data, row)
    values = np.stack([table[name].astype(np.float64) for name in row.names or ()], axis=1)
    scale = _values(items["SCAL"], {}) if "SCAL" in items else None
    if scale is None:
        return values
    if scale.size not in (1, values.shape[1]) or not scale.all():
        return None
    return np.asarray(values / scale.ravel())


def _fix(items: dict[str, _Item]) -> int:
    found = _values(items["GPSF"], {}) if "GPSF" in items else None
    return -1 if found is None else int(found[0, 0])
