"""ArduPilot's DataFlash files as tables of numbers.

A message begins with two bytes of a mark and the number of its type, and has no checksum; messages
``FMT`` describe the types. A message counts where another one follows it, or the end of the file.

Source: ArduPilot, libraries/AP_Logger, LogStructure.h and README.md; "mult" of the types as in
pymavlink's DFReader.
"""

from __future__ import annotations

import re
import struct
from typing import NamedTuple

import numpy as np

from ros_visualise.sources.logs.logged import LogFields
from ros_visualise.sources.logs.tables import Column, LogTable
from ros_visualise.sources.recordings import Loss

MAGIC = b"\xa3\x95"
FORMAT_TYPE = 0x80
_FORMAT = struct.Struct("<BB4s16s64s")
_TEXT = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_TIMES = {"TimeUS": 1, "TimeMS": 1000}
_TIME = ""  # the column of the time, microseconds; no field has this name


class _Kind(NamedTuple):
    """A letter of a format: its bytes, its values as they are kept, and their factor."""

    dtype: str
    ros: str
    factor: float = 1


_KINDS = {
    "a": _Kind("(32,)<i2", "int16"),
    "b": _Kind("i1", "int8"),
    "B": _Kind("u1", "uint8"),
    "h": _Kind("<i2", "int16"),
    "H": _Kind("<u2", "uint16"),
    "i": _Kind("<i4", "int32"),
    "I": _Kind("<u4", "uint32"),
    "q": _Kind("<i8", "int64"),
    "Q": _Kind("<u8", "uint64"),
    "g": _Kind("<f2", "float32"),
    "f": _Kind("<f4", "float32"),
    "d": _Kind("<f8", "float64"),
    "n": _Kind("S4", "string"),
    "N": _Kind("S16", "string"),
    "Z": _Kind("S64", "string"),
    "c": _Kind("<i2", "float64", 0.01),
    "C": _Kind("<u2", "float64", 0.01),
    "e": _Kind("<i4", "float64", 0.01),
    "E": _Kind("<u4", "float64", 0.01),
    "L": _Kind("<i4", "float64", 1e-7),
    "M": _Kind("u1", "uint8"),
}


class _Type:
    """A described type, and its messages as they lie in the file."""

    def __init__(self, name: str, letters: str, fields: list[str]) -> None:
        self.name, self.letters, self.fields = name, letters, fields
        self.instance = ""  # the field that tells one sensor from another
        self.bodies: list[bytes] = []
        columns = [(field, _KINDS[one].dtype) for field, one in zip(fields, letters, strict=True)]
        self.dtype = np.dtype(columns)

    @property
    def ros(self) -> LogFields:
        """Its fields as ROS has them."""
        return [
            (_KINDS[letter].ros, 32 if letter == "a" else 0, field)
            for field, letter in zip(self.fields, self.letters, strict=True)
        ]

    def columns(self) -> dict[str, Column]:
        """(N,) values by field, in their units, and the time; empty without a time."""
        table = np.frombuffer(b"".join(self.bodies), self.dtype)
        time = next((field for field in self.fields if field in _TIMES), "")
        if not time:
            return {}
        found: dict[str, Column] = {}
        for field, letter in zip(self.fields, self.letters, strict=True):
            factor = _KINDS[letter].factor
            if letter == "a":
                found |= {f"{field}[{n}]": table[field][:, n] for n in range(32)}
            else:
                found[field] = table[field] if factor == 1 else table[field] * factor
        found[_TIME] = np.minimum(table[time], 2**62 // _TIMES[time]).astype(np.int64)
        found[_TIME] *= _TIMES[time]
        return found


class DataFlash:
    """The messages of a file, as far as they can be read.

    Attributes:
        loss: damage.
    """

    def __init__(self, data: bytes) -> None:
        self.loss = Loss()
        self._data = data
        self._types: dict[int, _Type] = {}
        self._lengths = {FORMAT_TYPE: len(MAGIC) + 1 + _FORMAT.size}
        self._read()
        self._name_instances()

    @property
    def formats(self) -> dict[str, LogFields]:
        """The fields of each type."""
        return {one.name: one.ros for one in self._types.values()}

    def tables(self) -> dict[str, LogTable]:
        """Every type that has times, as ``GPS``; further sensors as ``GPS_1``."""
        found = {}
        for one in self._types.values():
            columns = one.columns() if one.bodies else {}
            if not columns:
                continue
            numbers = columns[one.instance] if one.instance else np.zeros(len(one.bodies), int)
            for number in np.unique(numbers).tolist():
                part = {name: values[numbers == number] for name, values in columns.items()}
                name = f"{one.name}_{number}" if number else one.name
                found[name] = LogTable(one.name, part, _TIME)
        return found

    def _read(self) -> None:
        data, end = self._data, len(self._data)
        place = damaged = strangers = 0
        while place < end:
            length = self._length_at(place)
            following = place + length
            if length and (following == end or data.startswith(MAGIC, following)):
                self._take(place, following)
                place = following
                continue
            found = data.find(MAGIC, place + 1)
            is_last = found < 0 and following > end
            if is_last:
                self.loss.add(f"cut off {end - place} bytes into its last message", 0, end - place)
                break
            found = end if found < 0 else found
            strangers += not length and data.startswith(MAGIC, place)
            damaged += found - place
            place = found
        if damaged:
            self.loss.add(f"{damaged} damaged bytes skipped", strangers, damaged)

    def _length_at(self, place: int) -> int:
        """Bytes of the message at a place; 0 without a known one."""
        if not self._data.startswith(MAGIC, place) or place + 2 >= len(self._data):
            return 0
        return self._lengths.get(self._data[place + 2], 0)

    def _take(self, place: int, end: int) -> None:
        number, body = self._data[place + 2], self._data[place + 3 : end]
        if number in self._types:
            self._types[number].bodies.append(body)
        if number == FORMAT_TYPE:
            self._describe(body)

    def _describe(self, body: bytes) -> None:
        """Keep a type's description; the first one of each counts."""
        number, length, *texts = _FORMAT.unpack(body)
        name, letters, labels = (text.split(b"\0")[0].decode("ascii", "replace") for text in texts)
        fields = labels.split(",") if labels else []
        names = [name, *fields]
        is_known = number == FORMAT_TYPE or number in self._types
        if is_known or len(fields) != len(letters) or not {*letters} <= _KINDS.keys():
            return
        if len({*fields}) != len(fields) or not all(map(_TEXT.fullmatch, names)):
            return
        described = _Type(name, letters, fields)
        if described.dtype.itemsize + 3 == length:
            self._types[number], self._lengths[number] = described, length

    def _name_instances(self) -> None:
        """Units of the fields tell which is the number of a sensor, by ``#``."""
        for one in self._types.values():
            if one.name != "FMTU" or not {"FmtType", "UnitIds"} <= {*one.fields}:
                continue
            table = np.frombuffer(b"".join(one.bodies), one.dtype)
            for number, units in zip(table["FmtType"].tolist(), table["UnitIds"], strict=True):
                at, described = bytes(units).find(b"#"), self._types.get(number)
                if described and 0 <= at < len(described.fields) and described.letters[at] in "bB":
                    described.instance = described.fields[at]
