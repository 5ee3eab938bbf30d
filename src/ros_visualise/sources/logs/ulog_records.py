"""The records of a ULog file, one after the other, over damage to the next that is whole.

Source: PX4 Developer Guide, ULog File Format.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.core.limits import object_limit

_FIELD = re.compile(r"(\w+)(?:\[(\d{1,5})\])? (\w+)", re.ASCII)
_NAME = re.compile(r"[\w/-]+", re.ASCII)
_BASIC = {
    **{"int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4"},
    **{"uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8"},
    **{"bool": "i1", "char": "i1"},
}
_PADDING = "_padding"
_TIME = "timestamp"
_LONGEST = 0xFFFF  # of a sample, as records say their size in 16 bits
_DEEPEST = 8
_MOST_TYPES = 4096  # PX4 has 300

MAGIC = b"ULog\x01\x12\x35"
_HEADER_BYTES = 16
_HEAD = struct.Struct("<HB")
_SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_SIZES = {"O": (2, 2), "B": (40, 0xFFFF), "S": (8, 8), "R": (2, 2), "F": (4, 0xFFFF)}
_SIZES |= {"A": (4, 0xFFFF), "D": (2, 0xFFFF), "L": (9, 0xFFFF), "C": (11, 0xFFFF)}
_SIZES |= dict.fromkeys("IMPQ", (2, 0xFFFF))
_LIMITS = {ord(kind): sizes for kind, sizes in _SIZES.items()}
_SYNC_KIND, _DATA, _FORMAT, _ADD, _DROPOUT, _FLAGS = map(ord, "SDFAOB")
_TEXTS_AT = {_FORMAT: 0, _ADD: 3, ord("L"): 9, ord("C"): 11}
_KEYS_AT = {ord("I"): 0, ord("P"): 0, ord("M"): 1, ord("Q"): 1}
_TEXT = re.compile(rb"[^\x00-\x08\x0e-\x1f\x7f]*\0*")
_KEY = re.compile(rb"[\w\[\]]+ [\w /.-]+")
_LONGEST_RECORD = _HEAD.size + 0xFFFF
_LEVELS = b"01234567"  # of what was logged as text
_CHAIN = 3  # so many whole records in a row do not come about by chance
_APPENDED = 1  # of the flags that a reader has to know
_FIRST_SEARCH, _MOST_SEARCH = 1 << 9, 1 << 20
_MOST_DAMAGES = 10_000  # of a file with more, the rest is not worth its time
_APPENDED_AT = struct.Struct("<3Q")

UlogFields = list[tuple[str, int, str]]
"""The fields of a type: the type of each, its count (0: one, no array), and its name."""


class BadFormat(ValueError):
    """An invalid type."""


class UlogTypes:
    """The types of a file by name; the first of a name counts.

    Attributes:
        by_name: their fields, without padding.
    """

    def __init__(self) -> None:
        self.by_name: dict[str, UlogFields] = {}
        self._all: dict[str, UlogFields] = {}
        self._sizes: dict[str, tuple[int, int]] = {}
        self._bad: dict[str, int] = {}  # how many types there were
        self._left = object_limit() // 4  # fields, which are objects of numpy's

    def add(self, text: str) -> bool:
        """Add a description, ``name:type field;type[3] other;``; true if it is valid."""
        name, _, rest = text.partition(":")
        found = [_FIELD.fullmatch(part.strip()) for part in rest.split(";") if part.strip()]
        fields = [(one[1], int(one[2] or 0), one[3]) for one in found if one]
        if not _NAME.fullmatch(name) or len(fields) < len(found) or not fields:
            return False
        if len(self._all) < _MOST_TYPES:
            self._all.setdefault(name, fields)
            named = [field for field in fields if not field[2].startswith(_PADDING)]
            self.by_name.setdefault(name, named)
        return True

    def sizes(self, name: str) -> tuple[int, int]:
        """Bytes of a sample, without and with padding at its end; raises BadFormat."""
        if self._bad.get(name) == len(self._all):
            raise BadFormat("the file does not define its type")
        if name not in self._sizes:
            self._bad[name] = len(self._all)
            whole = self._size(name, 0)
            del self._bad[name]
            self._sizes[name] = whole - self._padding(name), whole
        return self._sizes[name]

    def dtype(self, name: str) -> np.dtype[np.void]:
        """Layout of a sample with inner fields, without padding at its end; raises BadFormat."""
        least, _ = self.sizes(name)
        fields: list[tuple[str, str]] = []
        self._flatten(name, "", fields)
        while fields and fields[-1][0].startswith(_PADDING):
            fields.pop()
        try:
            dtype = np.dtype(fields)
        except ValueError:
            raise BadFormat("two of its fields share a name") from None
        if dict(fields).get(_TIME) != _BASIC["uint64_t"] or dtype.itemsize != least:
            raise BadFormat("it has no timestamp")
        return dtype

    def _size(self, name: str, depth: int) -> int:
        if name in _BASIC:
            return np.dtype(_BASIC[name]).itemsize
        if name not in self._all or depth > _DEEPEST:
            raise BadFormat("the file does not define its type")
        size = 0
        for kind, count, _ in self._all[name]:
            one = self._sizes[kind][1] if kind in self._sizes else self._size(kind, depth + 1)
            size += one * (count or 1)
            if size > _LONGEST:
                raise BadFormat("its type is too long")
        return size

    def _padding(self, name: str) -> int:
        """Bytes of padding at its end."""
        size = 0
        for kind, count, label in reversed(self._all[name]):
            if not (label.startswith(_PADDING) and kind in _BASIC):
                break
            size += self._size(kind, 0) * (count or 1)
        return size

    def _flatten(self, name: str, prefix: str, found: list[tuple[str, str]]) -> None:
        for kind, count, label in self._all[name]:
            for place in [f"[{number}]" for number in range(count)] or [""]:
                if kind not in _BASIC:
                    self._flatten(kind, f"{prefix}{label}{place}.", found)
                    continue
                self._left -= 1
                if self._left < 0:
                    raise BadFormat("this file describes too many fields")
                found.append((f"{prefix}{label}{place}", _BASIC[kind]))


class UnknownFlags(Exception):
    """The file needs a later reader."""


@dataclass
class LoggedTopic:
    """The samples of one instance of a topic, as they lie in the file."""

    name: str
    instance: int
    dtype: np.dtype[np.void]
    samples: bytearray = field(default_factory=bytearray)

    @property
    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """The samples by field, each an array (N,)."""
        table = np.frombuffer(self.samples, self.dtype)
        return {name: table[name] for name in self.dtype.names or ()}


class _Added(NamedTuple):
    """A topic that is logged from here on, and the least and most bytes of its samples."""

    name: str
    instance: int
    least: int
    most: int


class Records:
    """The records of a file, by what they hold.

    Every byte is looked at a bounded number of times, whatever the file says of itself, and what
    is kept is no larger than the file.

    Attributes:
        topics: topics with samples.
        formats: the types that the file describes.
        dropouts_ms: durations of the logger's own dropouts.
        strangers: number of samples of undescribed topics.
        damaged: number of bytes that belong to no record.
        cut: bytes of a last record that is cut off.

    Raises:
        UnknownFlags: the file needs a later reader.
    """

    def __init__(self, data: bytes) -> None:
        self.formats = UlogTypes()
        self.dropouts_ms: list[int] = []
        self.strangers = self.damaged = self.cut = 0
        self._data = data
        self._damages = 0
        self._added: dict[int, _Added] = {}
        self._least = np.full(1 << 16, -1, np.int32)  # bytes of a sample, by the topic's number
        self._most = np.full(1 << 16, -1, np.int32)
        self._topics: dict[tuple[str, int], LoggedTopic | None] = {}
        ends = [*self._appended(), len(data)]
        for start, end in zip([_HEADER_BYTES, *ends], ends, strict=False):
            self._read(start, end)

    @property
    def topics(self) -> Iterator[LoggedTopic]:
        """Topics with samples."""
        return (topic for topic in self._topics.values() if topic is not None and topic.samples)

    def _appended(self) -> list[int]:
        """Beginnings of the parts that were written after the vehicle had crashed."""
        if len(self._data) < _HEADER_BYTES + _HEAD.size:
            return []
        size, kind = _HEAD.unpack_from(self._data, _HEADER_BYTES)
        body = self._data[_HEADER_BYTES + _HEAD.size : _HEADER_BYTES + _HEAD.size + size]
        if kind != _FLAGS or not 40 <= len(body) == size:
            return []
        if body[8] & ~_APPENDED or any(body[9:16]):
            raise UnknownFlags
        offsets = _APPENDED_AT.unpack_from(body, 16) if body[8] & _APPENDED else ()
        first = _HEADER_BYTES + _HEAD.size + size
        return sorted({one for one in offsets if first < one < len(self._data)})

    def _read(self, place: int, end: int) -> None:
        while place < end:
            following = self._end_of(place, end)
            if following and self._take(place, following):
                place = following
                continue
            self._damages += 1
            found = self._find(place + 1, end) if self._damages < _MOST_DAMAGES else None
            if found is None and not following and end - place <= _LONGEST_RECORD:
                self.cut += end - place if end == len(self._data) else 0
                return
            self.damaged += (found or end) - place
            place = found or end

    def _end_of(self, place: int, end: int) -> int:
        """End of the record at a place; 0 without one."""
        if place + _HEAD.size > end:
            return 0
        size, kind = _HEAD.unpack_from(self._data, place)
        least, most = _LIMITS.get(kind, (1, 0))
        following = place + _HEAD.size + size
        return int(following) if least <= size <= most and following <= end else 0

    def _take(self, place: int, end: int) -> bool:
        """Keep the content of a record; false if it is none."""
        start, kind = place + _HEAD.size, self._data[place + 2]
        if kind == _DATA:
            return self._add_sample(start, end)
        if not self._is_likely(place, end):
            return False
        if kind == _FORMAT:
            return self.formats.add(self._data[start:end].decode("ascii", "replace"))
        if kind == _ADD:
            return self._add_topic(start, end)
        if kind == _DROPOUT:
            self.dropouts_ms.append(int.from_bytes(self._data[start:end], "little"))
        return True

    def _add_topic(self, start: int, end: int) -> bool:
        instance, number = self._data[start], self._number(start + 1)
        name = self._data[start + 3 : end].decode("ascii", "replace")
        try:
            least, most = self.formats.sizes(name)
        except BadFormat:
            return False
        self._added[number] = _Added(name, instance, least, most)
        self._least[number], self._most[number] = least, most
        return True

    def _add_sample(self, start: int, end: int) -> bool:
        added = self._added.get(self._number(start))
        if added is None:
            self.strangers += (is_whole := self._goes_on(end))
            return is_whole
        if not added.least <= end - start - 2 <= added.most:
            return False
        topic = self._topic(added.name, added.instance)
        if topic is None:
            self.strangers += 1
        else:
            topic.samples += self._data[start + 2 : start + 2 + added.least]
        return True

    def _number(self, at: int) -> int:
        return self._data[at] | self._data[at + 1] << 8

    def _topic(self, name: str, instance: int) -> LoggedTopic | None:
        """None if its samples cannot be read."""
        if (name, instance) not in self._topics:
            try:
                dtype = self.formats.dtype(name)
                self._topics[name, instance] = LoggedTopic(name, instance, dtype)
            except BadFormat:
                self._topics[name, instance] = None
        return self._topics[name, instance]

    def _goes_on(self, place: int) -> bool:
        """True if another record follows, or the end."""
        end = len(self._data)
        return place == end or bool(self._end_of(place, end))

    def _find(self, start: int, end: int) -> int | None:
        """Beginning of the next record that others follow."""
        size = _FIRST_SEARCH
        while start < end:
            block = np.frombuffer(self._data, np.uint8, min(size + 16, end - start), start)
            count = min(size, len(block) - _HEAD.size - 2)
            for place in self._candidates(block, max(0, count)).tolist():
                if self._begins_chain(start + place, end):
                    return start + int(place)
            start, size = start + size, min(2 * size, _MOST_SEARCH)
        return None

    def _candidates(self, block: npt.NDArray[np.uint8], count: int) -> npt.NDArray[np.intp]:
        """Places in a block at which a likely head of a record is."""
        kinds = block[2 : 2 + count]
        sizes = block[:count] | block[1 : 1 + count].astype(np.int32) << 8
        numbers = block[3 : 3 + count] | block[4 : 4 + count].astype(np.int32) << 8
        samples = sizes - 2
        is_one = (kinds == _DATA) & (samples >= self._least[numbers])
        is_one &= (samples <= self._most[numbers]) & (samples >= 0)
        is_one |= (kinds == _SYNC_KIND) & (sizes == len(_SYNC))
        is_one |= np.isin(kinds, [*_TEXTS_AT, *_KEYS_AT])
        return np.flatnonzero(is_one)

    def _begins_chain(self, place: int, end: int) -> bool:
        for number in range(_CHAIN):
            following = self._end_of(place, end)
            if not following or not (number or self._is_likely(place, following)):
                return False
            if following == end:
                return True
            place = following
        return True

    def _is_likely(self, place: int, end: int) -> bool:
        """True if a record begins as its kind does."""
        start, kind = place + _HEAD.size, self._data[place + 2]
        if kind == _SYNC_KIND:
            return self._data[start:end] == _SYNC
        if kind in _KEYS_AT:
            first = start + _KEYS_AT[kind] + 1
            key = self._data[first : first + self._data[first - 1]]
            return first + len(key) <= end and _KEY.fullmatch(key) is not None
        if kind in _TEXTS_AT:
            level = self._data[start] in _LEVELS or kind in (_FORMAT, _ADD)
            text = self._data[start + _TEXTS_AT[kind] : end]
            return level and _TEXT.fullmatch(text) is not None
        return True
