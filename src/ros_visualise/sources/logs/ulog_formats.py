"""The types that a ULog file describes, and how their samples lie in it.

Source: PX4 Developer Guide, ULog File Format, "Format Message".
"""

from __future__ import annotations

import re
from typing import NamedTuple

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

Format = list[tuple[str, int, str]]
"""The fields of a type: what each is of, how many (0: one, no array), and its name."""


class BadFormat(ValueError):
    """A type that no sample can be of."""


class Layout(NamedTuple):
    """How a sample lies: its fields, those of types inside others too, without padding at its end.

    ``longest`` is its size with that padding, which loggers leave out.
    """

    dtype: np.dtype[np.void]
    longest: int


class Formats:
    """The types of a file by name; the first of a name counts.

    Attributes:
        by_name: their fields, without padding.
    """

    def __init__(self) -> None:
        self.by_name: dict[str, Format] = {}
        self._all: dict[str, Format] = {}
        self._sizes: dict[str, tuple[int, int]] = {}
        self._bad: dict[str, int] = {}  # how many types there were
        self._left = object_limit() // 4  # fields, which are objects of numpy's

    def add(self, text: str) -> bool:
        """Take over a description, as ``name:type field;type[3] other;``; whether it is one."""
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
        """The least and most bytes of a sample.

        Raises:
            BadFormat: it is not described, within itself, or too long.
        """
        if self._bad.get(name) == len(self._all):
            raise BadFormat("its type is not described")
        if name not in self._sizes:
            self._bad[name] = len(self._all)
            whole = self._size(name, 0)
            del self._bad[name]
            self._sizes[name] = whole - self._padding(name), whole
        return self._sizes[name]

    def layout(self, name: str) -> Layout:
        """How a sample lies.

        Raises:
            BadFormat: as `sizes`; or it has no time, or there are too many fields in this file.
        """
        least, most = self.sizes(name)
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
        return Layout(dtype, most)

    def _size(self, name: str, depth: int) -> int:
        if name in _BASIC:
            return np.dtype(_BASIC[name]).itemsize
        if name not in self._all or depth > _DEEPEST:
            raise BadFormat("its type is not described")
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
        for kind, count, field in reversed(self._all[name]):
            if not (field.startswith(_PADDING) and kind in _BASIC):
                break
            size += self._size(kind, 0) * (count or 1)
        return size

    def _flatten(self, name: str, prefix: str, found: list[tuple[str, str]]) -> None:
        for kind, count, field in self._all[name]:
            for place in [f"[{number}]" for number in range(count)] or [""]:
                if kind not in _BASIC:
                    self._flatten(kind, f"{prefix}{field}{place}.", found)
                    continue
                self._left -= 1
                if self._left < 0:
                    raise BadFormat("this file describes too many fields")
                found.append((f"{prefix}{field}{place}", _BASIC[kind]))


def columns(layout: Layout, samples: bytearray) -> dict[str, npt.NDArray[np.generic]]:
    """The samples by field, each an array (N,)."""
    table = np.frombuffer(samples, layout.dtype)
    return {name: table[name] for name in layout.dtype.names or ()}
