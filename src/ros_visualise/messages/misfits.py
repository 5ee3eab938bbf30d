"""The reason why a message cannot be written: the first value that its ROS type cannot store."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from reprlib import repr
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Message
from ros_visualise.messages import to_message
from ros_visualise.messages.bounded import FILLER

_FLOATS = {"float32": "<f", "float64": "<d"}
_INTEGERS = {"byte": "uint8", "char": "uint8", "octet": "uint8"}


def refused(message: Any, error: Exception, store: Typestore) -> DamagedMessage:
    """The error for a message that cannot be written, for any exception of the library.

    Args:
        message: should be one of `ros_visualise.data`.
        error: the exception.
        store: the types.
    """
    if isinstance(error, DamagedMessage):
        return error
    if not isinstance(message, Message):
        return DamagedMessage(f"{repr(message)} is not a message")
    name = message.type_name
    return DamagedMessage(_find(message, store) or f"{name}: {error or type(error).__name__}")


def _find(message: Message, store: Typestore) -> str | None:
    """The invalid value, by the name of its field; None if unknown."""
    try:
        built = to_message(message, store.types)
        found = next(_misfits(store, message.type_name, built, ""), None)
    except Exception:  # it is not even built
        return None
    return None if found is None else f"{message.type_name}{found}"


def _misfits(store: Typestore, type_name: str, message: Any, place: str) -> Iterator[str]:
    for name, kind in store.fielddefs[type_name][1]:
        if name != FILLER:
            yield from _misfit(store, kind, getattr(message, name), f"{place}.{name}")


def _misfit(store: Typestore, kind: Any, value: Any, place: str) -> Iterator[str]:
    sort, about = kind
    if sort == Nodetype.NAME:
        yield from _misfits(store, about, value, place)
    elif sort == Nodetype.BASE:
        if not _holds(about[0], value):
            yield f"{place}: {repr(value)} is not a valid {about[0]}"
    elif not isinstance(value, np.ndarray):
        for number, one in enumerate(value):
            yield from _misfit(store, about[0], one, f"{place}[{number}]")


def _holds(base: str, value: Any) -> bool:
    """True if a value can be written as one of ROS's own types."""
    try:
        if base == "string":
            return isinstance(value, str) and bool(value.encode() or True)
        if base in _FLOATS:
            return bool(struct.pack(_FLOATS[base], value))
        if base == "bool":
            return True
        limits = np.iinfo(_INTEGERS.get(base, base))
        return bool(limits.min <= value.__index__() <= limits.max)
    except (AttributeError, TypeError, ValueError, OverflowError, struct.error):
        return False
