"""How much a message definition stands for: forty short lines can name a trillion fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.serde.utils import SIZEMAP

from ros_visualise.core.errors import TooLarge
from ros_visualise.core.limits import check_unpacked

_MOST_FIELDS = 20_000  # the library writes code for each; those of real types are hundreds
_DEEPEST = 50
_LENGTH_BYTES = 4  # before a string or a sequence
FILLER = "structure_needs_at_least_one_member"
"""The field of a type without fields in ROS 2; in ROS 1 it takes no bytes."""

Fields = Mapping[str, Any]
"""Type name -> constants and fields, as a typestore's ``fielddefs`` has them."""


class _Expanded(NamedTuple):
    """What a type stands for, with all that it is made of; bytes are those of fixed size."""

    fields: int = 1
    size: int = 0

    def times(self, count: int) -> _Expanded:
        return _Expanded(self.fields * count, self.size * count)


def check_expansion(type_name: str, known: Fields) -> None:
    """Look at a type before code is made for it.

    Args:
        known: the types that it may be made of.

    Raises:
        TooLarge: it contains itself, or stands for too much; says which.
    """
    found = _Expander(known).of(type_name, ())
    if found.fields > _MOST_FIELDS:
        raise TooLarge(f"its definition stands for more than {_MOST_FIELDS} fields")
    try:
        check_unpacked(found.size, 0)
    except TooLarge as error:
        raise TooLarge(f"each of its messages {error}") from None


class _Expander:
    def __init__(self, known: Fields) -> None:
        self._known = known
        self._found: dict[str, _Expanded] = {}

    def of(self, name: str, within: tuple[str, ...]) -> _Expanded:
        """What a type stands for that is a part of others, the innermost last."""
        if name in within:
            raise TooLarge("its definition contains itself")
        if len(within) > _DEEPEST:
            raise TooLarge(f"its definition is nested more than {_DEEPEST} deep")
        if name not in self._known:
            return _Expanded(size=_LENGTH_BYTES)  # which others say, and know better
        if name not in self._found:
            _, fields = self._known[name]
            parts = [self._field(kind, (*within, name)) for one, kind in fields if one != FILLER]
            self._found[name] = _Expanded(
                1 + sum(part.fields for part in parts), sum(part.size for part in parts)
            )
        return self._found[name]

    def _field(self, field: Any, within: tuple[str, ...]) -> _Expanded:
        kind, about = field
        if kind == Nodetype.NAME:
            return self.of(about, within)
        if kind == Nodetype.BASE:
            return _Expanded(size=SIZEMAP.get(about[0], _LENGTH_BYTES))
        one, count = about
        if kind == Nodetype.SEQUENCE:
            element = self._field(one, within)
            if not element.size:
                raise TooLarge("its definition has a sequence whose elements take no bytes")
            return element._replace(size=_LENGTH_BYTES)
        part = self._field(one, within).times(count)
        is_numbers = one[0] == Nodetype.BASE and one[1][0] != "string"
        return part._replace(fields=1) if is_numbers else part
