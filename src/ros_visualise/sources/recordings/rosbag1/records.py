"""The records that a ROS 1 bag consists of.

Source: the bag format 2.0, https://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import BinaryIO, NamedTuple

from ros_visualise.sources.recordings.unpacking import DamagedData, unpack_chunk

MAGIC = b"#ROSBAG V2.0\n"

_LONGEST_HEADER = 1 << 20  # those of real bags have less than 5 KB
_UINT32 = struct.Struct("<I")
_UINT64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")
_COMPRESSIONS = ("bz2", "lz4")

Fields = dict[bytes, bytes]


class Op(IntEnum):
    """Kinds of records."""

    MESSAGE = 2
    BAG_HEADER = 3
    INDEX = 4
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


class BagRecord(NamedTuple):
    """One record: its header, and the place of its data."""

    op: int
    fields: Fields
    data_position: int
    data_size: int

    @property
    def end(self) -> int:
        """Beginning of the next one."""
        return self.data_position + self.data_size


def read_record(file: BinaryIO, position: int, end: int) -> BagRecord:
    """The record at a place, whose header lies before ``end``; raises DamagedData."""
    if position >= end:
        raise DamagedData("no record")
    file.seek(position)
    header_size = _number(file.read(4))
    data_position = position + 8 + header_size
    if header_size > _LONGEST_HEADER or data_position > end:
        raise DamagedData("no record")
    fields = parse_fields(file.read(header_size))
    op = fields.get(b"op", b"")
    if len(op) != 1:
        raise DamagedData("a record without a kind")
    return BagRecord(op[0], fields, data_position, _number(file.read(4)))


def read_data(file: BinaryIO, record: BagRecord) -> bytes:
    """A record's data; raises DamagedData if it is cut off."""
    file.seek(record.data_position)
    data = file.read(record.data_size)
    if len(data) != record.data_size:
        raise DamagedData("cut off")
    return data


def parse_fields(data: bytes) -> Fields:
    """Name and value of each field of a header."""
    fields: Fields = {}
    position = 0
    while position < len(data):
        size = _number(data[position : position + 4])
        position += 4
        name, equals, value = data[position : position + size].partition(b"=")
        if position + size > len(data) or not equals:
            raise DamagedData("an unreadable header")
        fields[name] = value
        position += size
    return fields


def number(fields: Fields, name: bytes) -> int:
    """An unsigned number of 32 or 64 bits."""
    return _number(fields.get(name, b""))


def time_ns(fields: Fields, name: bytes) -> int:
    """A time as nanoseconds."""
    value = fields.get(name, b"")
    if len(value) != _TIME.size:
        raise DamagedData(f"the field {name.decode()} is not a valid time")
    sec, nanosec = _TIME.unpack(value)
    return int(sec) * 1_000_000_000 + int(nanosec)


def text(fields: Fields, name: bytes) -> str:
    """A text; empty if it is missing."""
    return fields.get(name, b"").decode("utf-8", "replace")


def decompress(compression: str, data: bytes, size: int, cut: bool = False) -> bytes:
    """The ``size`` bytes of a chunk, or those of one that is cut off; raises DamagedData."""
    if compression not in _COMPRESSIONS:
        raise DamagedData(f"unsupported compression {compression or 'without a name'}")
    return unpack_chunk(compression, data, size, cut)


def _number(data: bytes) -> int:
    if len(data) == _UINT32.size:
        return int(_UINT32.unpack(data)[0])
    if len(data) == _UINT64.size:
        return int(_UINT64.unpack(data)[0])
    raise DamagedData("expected a number")
