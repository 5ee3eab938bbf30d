"""Output for people in a terminal. Names come from untrusted files, so they are escaped.

All text for people on standard output and error goes through here, except for progress bars, which
hold no names. JSON is escaped by its library.
"""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any

from ros_visualise.core.errors import RosVisualiseError

_PASSWORD = re.compile(r"(://[^/?#:]*):[^/?#]*@")
_TOKEN = re.compile(r"/[\w-]{20,}(?=/foxglove$)")  # of another page
_QUERY = re.compile(r"(://[^?\s]*\?)\S+")


def escaped(text: str) -> str:
    r"""Text with all but printable characters escaped: ``\x1b``, ``\n``, ``\u202e``.

    So no terminal executes it, it stays on one line, and it reads in the order of its letters.
    Escaping it again changes nothing.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def without_secrets(address: str) -> str:
    """An address without its password or token, and without its query, which may hold one too."""
    found = _TOKEN.sub("/***", _PASSWORD.sub(r"\1:***@", address))
    return _QUERY.sub(r"\1***", found)


def print_status(line: str) -> None:
    """Print a line on standard error; if that is closed, print nothing."""
    with suppress(OSError):
        print(_encodable(escaped(line), sys.stderr.encoding), file=sys.stderr, flush=True)


def print_result(lines: Iterable[str]) -> None:
    """Print results on standard output, and flush it.

    Raises:
        BrokenPipeError: the reader has closed the pipe.
        RosVisualiseError: it cannot be written, as on a full disk.
    """
    text = "\n".join(map(escaped, lines))
    try:
        print(_encodable(text, sys.stdout.encoding), flush=True)
    except OSError as error:
        os.dup2(
            os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno()
        )  # otherwise it is tried again at exit
        if isinstance(error, BrokenPipeError):
            raise
        raise RosVisualiseError(f"standard output: {error.strerror}") from None


def print_log() -> None:
    """Print warnings and errors that are logged from now on, on standard error."""
    handler = logging.StreamHandler()
    handler.setFormatter(EscapingFormatter("ros-visualise: %(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)


def forward_log(levels: Mapping[int, Callable[[str], object]]) -> logging.Handler:
    """Hand what this package logs from now on to functions, such as those of a graph's log.

    Args:
        levels: level of `logging` -> the function for texts of that level.
    """
    handler = _Forwarder(levels)
    handler.setFormatter(EscapingFormatter())
    log = logging.getLogger("ros_visualise")
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    return handler


class _Forwarder(logging.Handler):
    def __init__(self, levels: Mapping[int, Callable[[str], object]]) -> None:
        super().__init__()
        self._levels = levels

    def emit(self, record: logging.LogRecord) -> None:
        level = max(one for one in self._levels if one <= max(record.levelno, logging.DEBUG))
        self._levels[level](self.format(record))


class EscapingFormatter(logging.Formatter):
    """Formats log records with their texts `escaped`; a traceback keeps its lines."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """The record's own line."""
        return escaped(super().formatMessage(record))

    def formatException(  # noqa: N802
        self,
        ei: tuple[type[BaseException], BaseException, TracebackType | None]
        | tuple[None, None, None],
    ) -> str:
        """The lines of a traceback."""
        return "\n".join(map(escaped, super().formatException(ei).split("\n")))


def _encodable(text: str, encoding: str | None) -> str:
    known = encoding or "ascii"
    return text.encode(known, "backslashreplace").decode(known)


def print_json(found: Any, **how: Any) -> None:
    """Print results as one line of JSON; ``how`` goes to `json.dumps`."""
    import json  # not at each --help

    print_result([json.dumps(found, **how)])


def in_columns(rows: Sequence[Sequence[str]], numbers: bool = False) -> list[str]:
    """Lines of cells, two blanks apart; with ``numbers``, all after the first end at the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    align = str.rjust if numbers else str.ljust
    return [
        "  ".join([row[0].ljust(widths[0]), *map(align, row[1:], widths[1:])]).rstrip()
        for row in rows
    ]


def counted(number: int, noun: str) -> str:
    """``1 message``, ``2 messages``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def in_seconds(time_ns: int) -> str:
    """A time in seconds with all its digits: a float has no nanoseconds of those since 1970."""
    seconds, nanoseconds = divmod(abs(time_ns), 10**9)
    return f"{'-' * (time_ns < 0)}{seconds}.{nanoseconds:09d}"


def sized(size: int) -> str:
    """Bytes as ``12.3 MB`` or ``1.2 kB``."""
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
