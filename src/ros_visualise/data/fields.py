"""Building and reading ROS messages of classes that the caller provides.

Fields have their ROS 2 names in lower case; other names of a version (``K`` and ``k``, ``secs`` and
``sec``) and missing fields are handled here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import Field, fields
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.data.header import Header

Types = Mapping[str, Any]

_NS = 1_000_000_000
_SECONDS = 2**31  # what ROS 2 holds; ROS 1 has one bit more
LATEST_NS = _SECONDS * _NS
"""The first time that is too late for a stamp."""
_SAME_AS = {"secs": "sec", "nsecs": "nanosec"}  # genpy's names


class Fields(NamedTuple):
    """A message before its class is known: the name of its type, and its fields."""

    type_name: str
    values: Mapping[str, Any]


class Either(NamedTuple):
    """A message whose type has another name in another version of ROS."""

    first: Fields
    other: Fields


class Columns(NamedTuple):
    """``length`` messages of one type before their class is known: each field's values in a row."""

    type_name: str
    length: int
    values: Mapping[str, Iterable[Any] | Columns]


def build(value: Any, types: Types) -> Any:
    """The message or messages for `Fields`, `Columns`, or a list of them; anything else as it is.

    Classes take their fields in order.
    """
    if isinstance(value, Fields):
        cls, values = types[value.type_name], value.values
        own = [build(values[name], types) for name in field_names(cls)]
        return cls(*map(_plain, own) if _slots(cls) else own)
    if isinstance(value, Columns):
        return _rows(value, types)
    if isinstance(value, Either):
        return build(value.first if _has(types, value.first.type_name) else value.other, types)
    return [build(item, types) for item in value] if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    """Empty bytes in the form that genpy's classes need inside another message."""
    is_bytes = isinstance(value, np.ndarray) and value.dtype == np.uint8
    return b"" if is_bytes and not value.size else value


def _has(types: Types, type_name: str) -> bool:
    try:
        return bool(types[type_name])  # some make classes on demand
    except KeyError:
        return False


def _rows(many: Columns, types: Types) -> list[Any]:
    cls = types[many.type_name]
    columns = {own: _column(many.values[name], types) for name, own in field_names(cls).items()}
    if not _slots(cls):
        return list(map(cls, *columns.values()))
    rows = [cls.__new__(cls) for _ in range(many.length)]
    for name, column in columns.items():
        fill = getattr(cls, name).__set__  # genpy's constructors take four times as long
        deque(map(fill, rows, column), maxlen=0)
    return rows


def _column(values: Iterable[Any] | Columns, types: Types) -> Iterable[Any]:
    return _rows(values, types) if isinstance(values, Columns) else values


def _slots(cls: Any) -> list[str]:
    """The slots of a class, or of the class that it is derived from."""
    return list(next(filter(None, (getattr(base, "__slots__", ()) for base in cls.__mro__)), ()))


@cache
def field_names(cls: Any) -> dict[str, str]:
    """The fields of a message class in its order: the table's name -> its own name."""
    names = _slots(cls) or [one.name for one in fields(cls) if not _is_constant(one)]
    lowered = {name: name.lower() for name in names if not name.startswith("_")}
    return {_SAME_AS.get(low, low): name for name, low in lowered.items()}


def _is_constant(one: Field[Any]) -> bool:
    return str(one.type).startswith("ClassVar")  # rosbags makes fields of a type's constants


def field_of(message: Any, name: str) -> Any:
    """A field by the table's name."""
    return getattr(message, field_names(message.__class__)[name])


def time(stamp_ns: int) -> Fields:
    """A time.

    Raises:
        ValueError: ROS cannot hold it.
    """
    sec, nanosec = divmod(stamp_ns, _NS)
    if not 0 <= sec < _SECONDS:
        raise _no_time(sec)
    return Fields("builtin_interfaces/msg/Time", {"sec": sec, "nanosec": nanosec})


def duration(length_ns: int) -> Fields:
    """A duration.

    Raises:
        ValueError: ROS cannot hold it.
    """
    sec, nanosec = divmod(length_ns, _NS)
    if not -_SECONDS <= sec < _SECONDS:
        raise ValueError(f"a duration of {sec} s: ROS can store 68 years at most")
    return Fields("builtin_interfaces/msg/Duration", {"sec": sec, "nanosec": nanosec})


def times(stamps_ns: npt.NDArray[np.int64]) -> Columns:
    """Many times; as `time`."""
    check_times(stamps_ns)
    sec, nanosec = np.divmod(stamps_ns, _NS)
    columns = {"sec": sec.tolist(), "nanosec": nanosec.tolist()}
    return Columns("builtin_interfaces/msg/Time", len(stamps_ns), columns)


def check_times(stamps_ns: npt.NDArray[np.int64]) -> None:
    """Check many times; raises as `time`."""
    sec = stamps_ns // _NS
    for wrong in sec[(sec < 0) | (sec >= _SECONDS)]:
        raise _no_time(wrong)


def read_time(time: Any) -> int:
    """Nanoseconds of a time."""
    return int(field_of(time, "sec")) * _NS + int(field_of(time, "nanosec"))


def header(header: Header) -> Fields:
    """A header; ROS 1 numbers messages itself when it sends them."""
    values = {"seq": 0, "stamp": time(header.stamp_ns), "frame_id": header.frame_id}
    return Fields("std_msgs/msg/Header", values)


def read_header(header: Any) -> Header:
    """Our header for one of a ROS message."""
    return Header(read_time(header.stamp), str(header.frame_id))


def _no_time(sec: int) -> ValueError:
    return ValueError(f"a stamp of {sec} s: the time must be between 1970 and 2038")
