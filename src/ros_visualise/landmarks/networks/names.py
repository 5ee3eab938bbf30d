"""Names of classes, by number."""

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
    """Class number -> name, from Ultralytics metadata: a Python dictionary or list as text.

    Anything else gives no names. Each name is parsed separately: deeply nested brackets could crash
    the process.
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
    """Class number -> name, from a text file with one name per line, the first for class 0.

    Raises:
        OpenError: it cannot be read, or is not such a text.
    """
    try:
        with open_file(path) as file:
            data = file.read(_MOST_BYTES + 1)
        lines = data.decode().splitlines()
    except FileNotFoundError:
        raise OpenError.missing(path, "give a text file with one class name per line") from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise OpenError(f"{path}: not a text file; give one class name per line") from None
    if len(data) > _MOST_BYTES or len(lines) > _MOST_CLASSES:
        raise OpenError(f"{path}: too long; give one class name per line")
    return {number: _clean(line) for number, line in enumerate(lines) if line.strip()}


def numbers_of(text: str, names: Mapping[int, str]) -> frozenset[int] | None:
    """Numbers of classes given by name or number, separated by commas; None for all.

    Raises:
        ParameterError: unknown class; the message lists some names.
    """
    wanted = [word.strip() for word in text.split(",") if word.strip()]
    by_name = {name: number for number, name in names.items()}
    for word in wanted:
        if word not in by_name and not word.isdecimal():
            there = ", ".join(list(by_name)[:_MOST_LISTED]) or "numbers, as no class has a name"
            more = ", ..." if len(by_name) > _MOST_LISTED else ""
            raise ParameterError(f"classes: no class {word!r}; choose from {there}{more}")
    return frozenset(by_name[word] if word in by_name else int(word) for word in wanted) or None


def _unquoted(text: str) -> str:
    try:
        return str(ast.literal_eval(text))
    except (SyntaxError, ValueError):  # such as an invalid escape
        return text[1:-1]


def _clean(name: str) -> str:
    """A name on one line, and short enough to be shown."""
    return "".join(c for c in name.strip() if c.isprintable())[:_LONGEST]
