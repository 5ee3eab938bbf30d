"""Values that options take: what a text is read as, and which are rejected."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path

from ros_visualise.core.errors import UsageError
from ros_visualise.core.limits import MAX_TAG_M, parse_memory
from ros_visualise.core.rate import MAX_RATE

_MAX_S = 1e9  # thirty years; with more, stamps are beyond what ROS holds


def _checked(
    kind: type[int] | type[float], accept: Callable[[float], bool], words: str
) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            number = kind(text)
        except ValueError:
            number = math.nan
        if not accept(number):
            raise ArgumentTypeError(f"{text!r} is not {words}")
        return number

    return parse


not_negative = _checked(float, lambda n: 0 <= n <= _MAX_S, f"a number from 0 to {_MAX_S:g}")
positive = _checked(float, lambda n: 0 < n <= _MAX_S, f"a number above 0, to {_MAX_S:g}")
tag_size = _checked(float, lambda n: 0 < n <= MAX_TAG_M, f"a number above 0, to {MAX_TAG_M:g}")
seed = _checked(int, lambda n: 0 <= n < 2**31, "a whole number from 0 to 2147483647")
rate = _checked(float, lambda n: 0 <= n <= MAX_RATE, f"a number from 0 to {MAX_RATE}")
count = _checked(int, lambda n: n >= 1, "a whole number of at least 1")
port = _checked(int, lambda n: 1 <= n <= 65535, "a port from 1 to 65535")


def memory(text: str) -> int:
    """A size, as 4G."""
    try:
        return parse_memory(text)
    except UsageError as error:
        raise ArgumentTypeError(str(error)) from None


def folder(text: str) -> Path:
    """The name of a folder."""
    if not text:
        raise ArgumentTypeError("give the name of a folder; . is the current one")
    return Path(text)
