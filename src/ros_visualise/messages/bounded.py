"""Reading messages that may become only so many objects: a byte of a message can stand for one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from rosbags.interfaces import Msgdef, Nodetype
from rosbags.serde import SerdeError
from rosbags.serde.utils import SIZEMAP
from rosbags.typesys.store import Typestore

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import object_limit
from ros_visualise.messages.expansion import FILLER

_LENGTH_BYTES = 4  # before a string or a sequence
_ARRAY_OBJECTS = 3  # an array takes as much as so many numbers


class _Made(NamedTuple):
    """What a type is made of.

    ``objects`` and ``size`` (bytes) are the least that one has; ``density`` is the most objects
    that a byte can become in a sequence, ``strings`` whether that may be one of strings.
    """

    objects: int = 1
    size: int = 0
    density: float = 0.0
    strings: bool = False


class BoundedStore(Typestore):
    """A typestore that refuses a message before it takes too much memory.

    Most messages are too short for that. Others are counted while they are read.

    Args:
        base: whose types it begins with.
    """

    def __init__(self, base: Typestore) -> None:
        super().__init__()
        self.fielddefs.update(base.fielddefs)
        self.types.update(base.types)
        self._parts: dict[str, _Made] = {}

    def forget(self) -> None:
        """Types have changed."""
        self.cache.clear()
        self._parts.clear()

    def deserialize_ros1(self, rawdata: bytes | memoryview, typename: str) -> object:
        """As `Typestore.deserialize_ros1`.

        Raises:
            TooLarge: the message becomes too many objects.
        """
        return self._read(Typestore.deserialize_ros1, rawdata, typename)

    def deserialize_cdr(self, rawdata: bytes | memoryview, typename: str) -> object:
        """As `Typestore.deserialize_cdr`.

        Raises:
            TooLarge: the message becomes too many objects.
        """
        return self._read(Typestore.deserialize_cdr, rawdata, typename)

    def own_objects(self, typename: str) -> int:
        """The objects of one message without those of the messages in it."""
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
        made, limit = self._made(typename), object_limit()
        if made.objects + made.density * size <= limit:
            return self
        if made.strings and size > limit * _LENGTH_BYTES:
            raise _too_many(limit)
        return _Counting(self, limit)

    def _made(self, typename: str) -> _Made:
        if typename not in self._parts:
            known = self.fielddefs[typename][1]
            fields = [self._field(field) for name, field in known if name != FILLER]
            self._parts[typename] = _Made(
                1 + sum(field.objects for field in fields),
                sum(field.size for field in fields),
                max((field.density for field in fields), default=0.0),
                any(field.strings for field in fields),
            )
        return self._parts[typename]

    def _field(self, field: Any) -> _Made:
        kind, about = field
        if kind == Nodetype.NAME:
            return self._made(about)
        if kind == Nodetype.BASE:
            return _Made(size=SIZEMAP.get(about[0], _LENGTH_BYTES))
        one, count = about
        is_string = one[0] == Nodetype.BASE and one[1][0] == "string"
        if one[0] == Nodetype.BASE and not is_string:
            bytes_ = SIZEMAP[one[1][0]] * count if kind == Nodetype.ARRAY else _LENGTH_BYTES
            return _Made(_ARRAY_OBJECTS, bytes_)
        element = self._field(one)
        if kind == Nodetype.ARRAY:
            return element._replace(
                objects=_ARRAY_OBJECTS + element.objects * count, size=element.size * count
            )
        density = element.objects / element.size if element.size else math.inf
        density = max(element.density, density)
        return _Made(_ARRAY_OBJECTS, _LENGTH_BYTES, density, element.strings or is_string)


class _Counting(Typestore):
    """What the library's readers ask for the reader of each type that a message is made of.

    Args:
        store: has the types.
        limit: of the objects.
    """

    def __init__(self, store: BoundedStore, limit: int) -> None:
        super().__init__()
        self._store, self._limit, self._count = store, limit, 0
        self.types, self.fielddefs = store.types, store.fielddefs

    def get_msgdef(self, typename: str) -> Msgdef[object]:
        """As `Typestore.get_msgdef`."""
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
    return TooLarge(
        f"a message of more than {limit} values; if you trust it, add a larger --max-memory"
    )
