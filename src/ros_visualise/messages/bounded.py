"""Limits for messages and their types: a byte of a message can become an object, and forty short
lines of a definition can name a trillion fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

from rosbags.interfaces import Msgdef, Nodetype
from rosbags.serde import SerdeError
from rosbags.serde.utils import SIZEMAP
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_unpacked, object_limit

FILLER = "structure_needs_at_least_one_member"
"""The field of a type without fields in ROS 2; in ROS 1 it takes no bytes."""
_MAX_FIELDS = 20_000  # the library writes code for each; real types have hundreds
_MAX_DEPTH = 50
_LENGTH_BYTES = 4  # before a string or a sequence
_ARRAY_OBJECTS = 3  # an array takes as much memory as so many numbers


class _Cost(NamedTuple):
    """Cost of a type, with the types of its fields.

    ``fields``, ``size`` (bytes) and ``objects`` are the least that a message has; ``density`` is
    the largest number of objects per byte of a sequence, and ``strings`` is true if that may be one
    of strings.
    """

    fields: int = 1
    size: int = 0
    objects: int = 1
    density: float = 0.0
    strings: bool = False


class _Costs:
    """Costs of types.

    Args:
        known: type name -> constants and fields, as in a typestore's ``fielddefs``.
    """

    def __init__(self, known: Mapping[str, Any]) -> None:
        self._known = known
        self._found: dict[str, _Cost] = {}

    def of(self, name: str, within: tuple[str, ...] = ()) -> _Cost:
        """Cost of a type that is a field of others, the innermost last.

        Raises:
            TooLarge: it contains itself, is nested too deeply, or has a sequence without end.
        """
        if name in within:
            raise TooLarge("its definition contains itself")
        if len(within) > _MAX_DEPTH:
            raise TooLarge(f"its definition is nested more than {_MAX_DEPTH} deep")
        if name not in self._known:
            return _Cost(size=_LENGTH_BYTES)  # reported elsewhere
        if name not in self._found:
            _, fields = self._known[name]
            parts = [self._field(kind, (*within, name)) for one, kind in fields if one != FILLER]
            self._found[name] = _Cost(
                1 + sum(part.fields for part in parts),
                sum(part.size for part in parts),
                1 + sum(part.objects for part in parts),
                max((part.density for part in parts), default=0.0),
                any(part.strings for part in parts),
            )
        return self._found[name]

    def _field(self, field: Any, within: tuple[str, ...]) -> _Cost:
        kind, about = field
        if kind == Nodetype.NAME:
            return self.of(about, within)
        if kind == Nodetype.BASE:
            return _Cost(size=SIZEMAP.get(about[0], _LENGTH_BYTES))
        one, count = about
        element = self._field(one, within)
        is_array, is_base = kind == Nodetype.ARRAY, one[0] == Nodetype.BASE
        is_string = is_base and one[1][0] == "string"
        size = element.size * count if is_array else _LENGTH_BYTES
        if is_base and not is_string:
            return _Cost(size=size, objects=_ARRAY_OBJECTS)
        if is_array:
            objects = _ARRAY_OBJECTS + element.objects * count
            return element._replace(fields=element.fields * count, size=size, objects=objects)
        if not element.size:
            raise TooLarge("its definition has a sequence whose elements take no bytes")
        density = max(element.density, element.objects / element.size)
        strings = element.strings or is_string
        return _Cost(element.fields, size, _ARRAY_OBJECTS, density, strings)


def check_definition(type_name: str, known: Mapping[str, Any]) -> None:
    """Check a type before code is generated for it.

    Args:
        known: the types that it may consist of; see `_Costs`.

    Raises:
        TooLarge: it contains itself, or is too large; says which.
    """
    cost = _Costs(known).of(type_name)
    if cost.fields > _MAX_FIELDS:
        raise TooLarge(f"its definition expands to more than {_MAX_FIELDS} fields")
    try:
        check_unpacked(cost.size, 0)
    except TooLarge as error:
        raise TooLarge(f"each of its messages {error}") from None


class BoundedStore(Typestore):
    """A typestore that rejects a message before it takes too much memory.

    Most messages are too short for that. Objects of others are counted while they are read.

    Args:
        base: the store whose types it begins with.
    """

    def __init__(self, base: Typestore) -> None:
        super().__init__()
        self.fielddefs.update(base.fielddefs)
        self.types.update(base.types)
        self._costs = _Costs(self.fielddefs)

    def forget(self) -> None:
        """Clear the caches, as types have changed."""
        self.cache.clear()
        self._costs = _Costs(self.fielddefs)

    def deserialize_ros1(self, rawdata: bytes | memoryview, typename: str) -> object:
        return self._read(Typestore.deserialize_ros1, rawdata, typename)

    def deserialize_cdr(self, rawdata: bytes | memoryview, typename: str) -> object:
        return self._read(Typestore.deserialize_cdr, rawdata, typename)

    def own_objects(self, typename: str) -> int:
        """Number of objects of one message, without the messages in it."""
        kinds = [kind for _, (kind, _) in self.fielddefs[typename][1]]
        numbers = sum(kind == Nodetype.BASE for kind in kinds)
        arrays = sum(kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) for kind in kinds)
        return 1 + numbers + _ARRAY_OBJECTS * arrays

    def _read(
        self,
        read: Callable[[Typestore, bytes | memoryview, str], object],
        rawdata: bytes | memoryview,
        typename: str,
    ) -> object:
        try:
            return read(self._reader(typename, len(rawdata)), rawdata, typename)
        except SerdeError as error:  # the library wraps what its readers raise
            if isinstance(error.__cause__, TooLarge):
                raise error.__cause__ from None
            raise

    def _reader(self, typename: str, size: int) -> Typestore:
        cost, limit = self._costs.of(typename), object_limit()
        if cost.objects + cost.density * size <= limit:
            return self
        if cost.strings and size > limit * _LENGTH_BYTES:
            raise _too_many(limit)
        return _CountingStore(self, limit)


class _CountingStore(Typestore):
    """Counts the objects of one message: the library's readers ask it for readers of its parts.

    Args:
        store: the store with the types.
        limit: maximum number of objects.
    """

    def __init__(self, store: BoundedStore, limit: int) -> None:
        super().__init__()
        self._store, self._limit, self._count = store, limit, 0
        self.types, self.fielddefs = store.types, store.fielddefs

    def get_msgdef(self, typename: str) -> Msgdef[object]:
        if typename not in self.cache:
            made = self._store.get_msgdef(typename)
            objects = self._store.own_objects(typename)
            self.cache[typename] = replace(
                made,
                deserialize_ros1=self._counted(made.deserialize_ros1, objects),
                deserialize_cdr_le=self._counted(made.deserialize_cdr_le, objects),
                deserialize_cdr_be=self._counted(made.deserialize_cdr_be, objects),
            )
        return self.cache[typename]

    def _counted(self, read: Callable[..., Any], objects: int) -> Callable[..., Any]:
        def read_one(*arguments: Any) -> Any:
            self._count += objects
            if self._count > self._limit:
                raise _too_many(self._limit)
            return read(*arguments)

        return read_one


def _too_many(limit: int) -> TooLarge:
    return TooLarge(f"a message of more than {limit} values; if you trust it, raise --max-memory")
