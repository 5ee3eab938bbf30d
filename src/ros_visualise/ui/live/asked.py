"""Requests of browsers on WebSockets, checked by their declared types."""

from __future__ import annotations

import math
from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta, Struct

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Spec

T = TypeVar("T")
MAX_WHOLE = 2**53
"""JavaScript is exact up to here."""

Name = Annotated[str, Meta(max_length=256)]
Text = Annotated[str, Meta(max_length=4096)]
Given = bool | int | float | Text
Whole = Annotated[int, Meta(ge=0, le=MAX_WHOLE)]


class Asked(Struct, tag_field="do", forbid_unknown_fields=True):
    """A request, by its name in ``do``."""


def understand(decoder: msgspec.json.Decoder[T], text: str) -> T | None:
    """The request in a text; None for any that our pages do not send."""
    try:
        return decoder.decode(text)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None


def check_type(spec: Spec, value: Given) -> None:
    """Raise ParameterError for a value of another type than a parameter's."""
    if spec.type is bool:
        fits = isinstance(value, bool)
    elif spec.type in (int, float):
        fits = _is_number(value)
    else:
        fits = isinstance(value, str)
    if not fits:
        kind = {bool: "true or false", int: "a whole number", float: "a finite number"}
        raise ParameterError(f"{spec.name}: must be {kind.get(spec.type, 'a string')}")


def _is_number(value: Given) -> bool:
    if isinstance(value, (bool, str)):
        return False
    return math.isfinite(value) and abs(value) <= MAX_WHOLE
