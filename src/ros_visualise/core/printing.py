"""What people read in a terminal. Names come from files of strangers: they are shown, never obeyed.

All that goes to standard output or error for people goes through here, but progress bars, which
hold no names. JSON has escapes of its own.
"""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Iterable
from contextlib import suppress
from types import TracebackType
from typing import Any

from ros_visualise.core.errors import RosVisualiseError

_PASSWORD = re.compile(r"(://[^/?#:]*):[^/?#]*@")
_QUERY = re.compile(r"(://[^?\s]*\?)\S+")


def shown(text: str) -> str:
    r"""Text in which everything but printable characters is escaped: ``\x1b``, ``\n``, ``\u202e``.

    So no terminal takes it for a command, it stays one line, and it reads in the order in which it
    is written. To do it again changes nothing.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def without_secrets(address: str) -> str:
    """An address without its password and its query, in which cameras take passwords too."""
    return _QUERY.sub(r"\1***", _PASSWORD.sub(r"\1:***@", address))


def say(line: str) -> None:
    """Print a line on standard error. That nobody is there to read it is no error."""
    with suppress(OSError):
        print(_encodable(shown(line), sys.stderr.encoding), file=sys.stderr, flush=True)


def answer(lines: Iterable[str]) -> None:
    """Print what was asked for on standard output, at once.

    Raises:
        BrokenPipeError: whoever read it has seen enough.
        RosVisualiseError: it cannot be written, as on a full disk.
    """
    text = "\n".join(map(shown, lines))
    try:
        print(_encodable(text, sys.stdout.encoding), flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else it is tried at exit
        if isinstance(error, BrokenPipeError):
            raise
        raise RosVisualiseError(f"standard output: {error.strerror}") from None


def say_what_is_logged() -> None:
    """Print on standard error what is logged from now on, from warnings on."""
    handler = logging.StreamHandler()
    handler.setFormatter(Shown("ros-visualise: %(message)s"))
    logging.basicConfig(handlers=[handler], level=logging.WARNING)


class Shown(logging.Formatter):
    """Formats log records with their texts `shown`; a traceback keeps its lines."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802
        """The record's own line."""
        return shown(super().formatMessage(record))

    def formatException(  # noqa: N802
        self,
        ei: tuple[type[BaseException], BaseException, TracebackType | None]
        | tuple[None, None, None],
    ) -> str:
        """The lines of a traceback."""
        return "\n".join(map(shown, super().formatException(ei).split("\n")))


def _encodable(text: str, encoding: str | None) -> str:
    known = encoding or "ascii"
    return text.encode(known, "backslashreplace").decode(known)


def answer_json(found: Any, **how: Any) -> None:
    """Print what was asked for as one line of JSON; ``how`` goes to `json.dumps`."""
    import json  # not at each --help

    answer([json.dumps(found, **how)])


def counted(number: int, noun: str) -> str:
    """``1 message``, ``2 messages``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def sized(size: int) -> str:
    """Bytes as ``12.3 MB`` or ``1.2 kB``."""
    return f"{size / 1e6:.1f} MB" if size >= 1e6 else f"{size / 1e3:.1f} kB"
