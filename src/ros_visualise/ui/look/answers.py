"""What is answered to a browser, and what it may ask for: everything that it sends is checked."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NamedTuple
from urllib.parse import parse_qs

HEADER = "X-Ros-Visualise"
"""What our own pages send with each question. No other site can: browsers would ask us first."""
READ_ONLY = "this address is read-only"
MAX_QUERY = 8192
"""Characters of a question; the names of many fields are the longest."""


class Refusal(Exception):
    """A question that has no answer; the text is for the person who asked, ``status`` HTTP's."""

    def __init__(self, text: str, status: int = 400) -> None:
        super().__init__(text)
        self.status = status

    @property
    def answer(self) -> Answer:
        """What is answered."""
        return as_json({"error": str(self)}, self.status)


class Answer(NamedTuple):
    """A status of HTTP, the body and its type, and more headers."""

    body: bytes | memoryview
    type: str = "application/json"
    status: int = 200
    headers: Mapping[str, str] = {}


class Question:
    """The part of an address after the ``?``.

    Raises:
        Refusal: it is too long or damaged.
    """

    def __init__(self, query: str) -> None:
        if len(query) > MAX_QUERY:
            raise Refusal("the question is too long", 414)
        try:
            found = parse_qs(query, keep_blank_values=True, errors="strict", max_num_fields=200)
        except ValueError:
            raise Refusal("the question cannot be read") from None
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
        """A whole number that fits 64 bits; None if it is not there.

        Raises:
            Refusal: it is none.
        """
        text = self.text(name)
        if not text:
            return None
        if not (text.removeprefix("-").isascii() and text.removeprefix("-").isdecimal()):
            raise Refusal(f"{name}: give a whole number")
        if len(text) > 19 or abs(int(text)) >= 2**63:
            raise Refusal(f"{name}: the number is too large")
        return int(text)

    def seconds(self, name: str) -> float:
        """A number from 0 to 1e9.

        Raises:
            Refusal: it is none.
        """
        try:
            value = float(self.text(name))
        except ValueError:
            value = -1.0
        if not 0 <= value <= 1e9:
            raise Refusal(f"{name}: give seconds, 0 or more")
        return value


def as_json(value: Any, status: int = 200) -> Answer:
    """An answer of any values that JSON has; NaN and infinities are null there."""
    return Answer(json.dumps(value, allow_nan=False, ensure_ascii=False).encode(), status=status)
