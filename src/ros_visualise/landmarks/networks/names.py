"""Names of classes, which a network knows by number."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from pathlib import Path

from ros_visualise.errors import OpenError

_MOST_BYTES = 1 << 20
_MOST_CLASSES = 10_000
_LONGEST = 100
_ENTRY = re.compile(r"""(?:(\d{1,9})\s*:\s*)?('(?:[^'\\\n]|\\.)*'|"(?:[^"\\\n]|\\.)*")""")


def names_in(metadata: Mapping[str, str]) -> dict[int, str]:
    """Class number -> name, as Ultralytics writes them: a dictionary or list of Python's as text.

    What is none of that has no names. Each name is read by itself: a text of many brackets could
    end the whole process.
    """
    text = metadata.get("names", "")
    if len(text) > _MOST_BYTES:
        return {}
    found: dict[int, str] = {}
    for number, quoted in _ENTRY.findall(text):
        at = int(number) if number else len(found)
        if at < _MOST_CLASSES:
            found[at] = _clean(_unquoted(quoted))
    return found


def load_names(path: str) -> dict[int, str]:
    """Class number -> name from a text file with one name a line, the first for class 0.

    Raises:
        OpenError: it cannot be read, or is no such text.
    """
    try:
        with Path(path).open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        lines = data.decode().splitlines()
    except FileNotFoundError:
        raise OpenError.missing(path, "give a text file with one name of a class a line") from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise OpenError(f"{path}: no text; give one name of a class a line") from None
    if len(data) > _MOST_BYTES or len(lines) > _MOST_CLASSES:
        raise OpenError(f"{path}: too long; give one name of a class a line")
    return {number: _clean(line) for number, line in enumerate(lines) if line.strip()}


def _unquoted(text: str) -> str:
    try:
        return str(ast.literal_eval(text))
    except (SyntaxError, ValueError):  # such as an escape that is none
        return text[1:-1]


def _clean(name: str) -> str:
    """On one line, and short enough to be shown."""
    return "".join(c for c in name.strip() if c.isprintable())[:_LONGEST]
