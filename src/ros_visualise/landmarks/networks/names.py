"""Names of classes, which a network knows by number."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.regular_files import open_file

_MOST_BYTES = 1 << 20
_MOST_CLASSES = 10_000
_LONGEST = 100
_MOST_LISTED = 20
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
        with open_file(path) as file:
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


def numbers_of(text: str, names: Mapping[int, str]) -> frozenset[int] | None:
    """The numbers of classes, which a person names or numbers, with commas between; all: None.

    Raises:
        ParameterError: there is no class of such a name; some that there are are listed.
    """
    wanted = [word.strip() for word in text.split(",") if word.strip()]
    by_name = {name: number for number, name in names.items()}
    for word in wanted:
        if word not in by_name and not word.isdecimal():
            there = ", ".join(list(by_name)[:_MOST_LISTED]) or "their numbers, as none has a name"
            more = ", ..." if len(by_name) > _MOST_LISTED else ""
            raise ParameterError(f"classes: no class {word!r}; choose from {there}{more}")
    return frozenset(by_name[word] if word in by_name else int(word) for word in wanted) or None


def _unquoted(text: str) -> str:
    try:
        return str(ast.literal_eval(text))
    except (SyntaxError, ValueError):  # such as an escape that is none
        return text[1:-1]


def _clean(name: str) -> str:
    """On one line, and short enough to be shown."""
    return "".join(c for c in name.strip() if c.isprintable())[:_LONGEST]
