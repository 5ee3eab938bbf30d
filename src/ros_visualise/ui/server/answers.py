"""Queries of browsers, which are checked, and the answers to them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple
from urllib.parse import parse_qs

HEADER = "X-Ros-Visualise"
"""The header of our own pages' queries. No other site can send it without our permission."""
READ_ONLY = "this address is read-only"
MAX_QUERY = 8192
"""Maximum characters of a query; the names of many fields are the longest."""


class Refusal(Exception):
    """A query without an answer; the text is for the person, ``status`` is HTTP's."""

    def __init__(self, text: str, status: int = 400) -> None:
        super().__init__(text)
        self.status = status

    @property
    def answer(self) -> Answer:
        return as_json({"error": str(self)}, self.status)


class Answer(NamedTuple):
    """A status of HTTP, the body and its type, and more headers."""

    body: bytes | memoryview
    type: str = "application/json"
    status: int = 200
    headers: Mapping[str, str] = {}


class BrowserQuery:
    """The part of an address after the ``?``.

    Raises:
        Refusal: it is too long or damaged.
    """

    def __init__(self, query: str) -> None:
        if len(query) > MAX_QUERY:
            raise Refusal("the query is too long", 414)
        try:
            found = parse_qs(query, keep_blank_values=True, errors="strict", max_num_fields=200)
        except ValueError:
            raise Refusal("malformed query") from None
        self._values = found

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def text(self, name: str, default: str = "") -> str:
        """One value by its name."""
        return self._values.get(name, [default])[0]

    def texts(self, name: str) -> list[str]:
        """All values of that name."""
        return self._values.get(name, [])

    def whole(self, name: str) -> int | None:
        """A whole number of up to 64 bits, or None; raises Refusal for anything else."""
        text = self.text(name)
        if not text:
            return None
        if not (text.removeprefix("-").isascii() and text.removeprefix("-").isdecimal()):
            raise Refusal(f"{name}: give a whole number")
        if len(text) > 19 or abs(int(text)) >= 2**63:
            raise Refusal(f"{name}: the number is too large")
        return int(text)

    def seconds(self, name: str) -> float:
        """A number from 0 to 1e9; raises Refusal for anything else."""
        try:
            value = float(self.text(name))
        except ValueError:
            value = -1.0
        if not 0 <= value <= 1e9:
            raise Refusal(f"{name}: give a number of seconds, 0 or more")
        return value


def as_json(value: Any, status: int = 200) -> Answer:
    """An answer in JSON; NaN and infinities have to be null."""
    return Answer(json.dumps(value, allow_nan=False, ensure_ascii=False).encode(), status=status)
