"""ROS messages from plain values, as JSON and CBOR have them."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping
from reprlib import repr
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data.fields import field_names
from ros_visualise.messages.bounded import FILLER

_DTYPES = {"byte": "u1", "char": "u1", "octet": "u1", "float32": "f4", "float64": "f8"}
_FLOATS = ("float32", "float64")
_SAME_AS = {"secs": "sec", "nsecs": "nanosec"}  # of ROS 1
_ARRAYS = (list, tuple, np.ndarray, bytes)
_MOST_FIELDS, _MOST_ELEMENTS = 2000, 1000


def fill(store: Typestore, type_name: str, values: Any) -> Any:
    """The message of a type with these values; missing fields are zero or empty.

    Args:
        store: the types.
        type_name: as ``geometry_msgs/msg/Twist``.
        values: by field; bytes may be in base64, and null is NaN.

    Raises:
        DamagedMessage: an unknown field, or a value that its field cannot hold; names it.
    """
    return _message(store, type_name, values, "")


def plain(message: Any) -> Any:
    """The values of a message, as `fill` takes them."""
    if isinstance(message, np.ndarray | np.generic):
        return message.tolist()
    if isinstance(message, list | tuple):
        return [plain(one) for one in message]
    if isinstance(message, str | bool | int | float):
        return message
    names = field_names(message.__class__).values()
    return {name: plain(getattr(message, name)) for name in names if name != FILLER}


def described(store: Typestore, type_name: str) -> list[dict[str, Any]]:
    """The fields of a type: ``name``, ``type``, and ``fields`` or the default ``value``.

    The value of a very long array is empty.
    """
    return list(_described(store, type_name, iter(range(_MOST_FIELDS))))


def _message(store: Typestore, type_name: str, values: Any, place: str) -> Any:
    if not isinstance(values, Mapping):
        raise DamagedMessage(f"{place or type_name}: must be an object, not {repr(values)}")
    given = {_SAME_AS.get(name, name): value for name, value in values.items()}
    fields = {name: kind for name, kind in store.fielddefs[type_name][1] if name != FILLER}
    for name in given:
        if name not in fields:
            raise DamagedMessage(f"{place or type_name}: no field {repr(name)}")
    made = {
        name: _value(store, kind, given.get(name, ...), f"{place}.{name}" if place else name)
        for name, kind in fields.items()
    }
    if not fields and store.fielddefs[type_name][1]:
        made = {FILLER: 0}
    return store.types[type_name](**made)


def _value(store: Typestore, kind: Any, value: Any, place: str) -> Any:
    sort, about = kind
    if sort == Nodetype.NAME:
        return _message(store, about, {} if value is ... else value, place)
    if sort == Nodetype.BASE:
        return _single(about[0], value, place)
    element, size = about
    if value is ... and sort == Nodetype.ARRAY:
        value = np.zeros(size, np.uint8) if _is_number(element) else [...] * size
    found = _array(store, element, () if value is ... else value, place)
    if len(found) != size and (sort == Nodetype.ARRAY or len(found) > size > 0):
        raise DamagedMessage(f"{place}: must have {size} elements, not {len(found)}")
    return found


def _array(store: Typestore, element: Any, values: Any, place: str) -> Any:
    _, about = element
    is_numbers = _is_number(element)
    if is_numbers and isinstance(values, str):
        values = _from_base64(values, place)
    if not isinstance(values, _ARRAYS):
        raise DamagedMessage(f"{place}: must be a list, not {repr(values)}")
    if not is_numbers:
        return [_value(store, element, one, f"{place}[{i}]") for i, one in enumerate(values)]
    dtype = np.dtype(_DTYPES.get(about[0], about[0]))
    if isinstance(values, bytes) and dtype.itemsize == 1:
        return np.frombuffer(values, dtype)
    if isinstance(values, np.ndarray) and np.can_cast(values.dtype, dtype):
        return values.astype(dtype, copy=False)
    made = [_single(about[0], one, f"{place}[{i}]") for i, one in enumerate(values)]
    return np.array(made, dtype)


def _is_number(element: Any) -> bool:
    sort, about = element
    return bool(sort == Nodetype.BASE and about[0] not in ("string", "wstring"))


def _from_base64(text: str, place: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except ValueError:
        raise DamagedMessage(f"{place}: neither a list nor base64") from None


def _single(base: str, value: Any, place: str) -> Any:
    if base in ("string", "wstring"):
        if value is ... or isinstance(value, str):
            return "" if value is ... else value
        raise DamagedMessage(f"{place}: must be a string, not {repr(value)}")
    if value is ...:
        return False if base == "bool" else 0.0 if base in _FLOATS else 0
    if isinstance(value, np.generic):
        value = value.item()
    if base == "bool":
        if value in (0, 1):
            return bool(value)
        raise DamagedMessage(f"{place}: must be true or false, not {repr(value)}")
    if base in _FLOATS:
        return _float(base, value, place)
    limits = np.iinfo(np.dtype(_DTYPES.get(base, base)))
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if not isinstance(value, int) or not limits.min <= value <= limits.max:
        whole = f"a whole number from {limits.min} to {limits.max}"
        raise DamagedMessage(f"{place}: must be {whole}, not {repr(value)}")
    return int(value)


def _float(base: str, value: Any, place: str) -> float:
    if value is None:
        return math.nan
    if isinstance(value, str) and value.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        value = float(value)
    most = float(np.finfo(base).max)
    if not isinstance(value, int | float) or (abs(value) > most and value not in _INFINITE):
        raise DamagedMessage(f"{place}: must be a number, not {repr(value)}")
    return float(value)


_INFINITE = (math.inf, -math.inf)


def _described(store: Typestore, type_name: str, left: Iterator[int]) -> Iterator[dict[str, Any]]:
    fields: Any = store.fielddefs[type_name][1]
    for name, (sort, about) in fields:
        if name == FILLER or next(left, None) is None:
            continue
        if sort == Nodetype.NAME:
            yield {"name": name, "type": about, "fields": list(_described(store, about, left))}
        elif sort == Nodetype.BASE:
            yield {"name": name, "type": about[0], "value": _single(about[0], ..., "")}
        else:
            is_array, (element, size) = sort == Nodetype.ARRAY, about
            kind = element[1] if element[0] == Nodetype.NAME else element[1][0]
            length = size if is_array else f"<={size}" if size else ""
            one = {} if element[0] == Nodetype.NAME else _single(kind, ..., "")
            value = [one] * size if is_array and size <= _MOST_ELEMENTS else []
            yield {"name": name, "type": f"{kind}[{length}]", "value": value}
