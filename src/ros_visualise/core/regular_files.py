"""Opening regular files to read, so that nothing blocks.

A pipe or a device may have the name of a file, alone or within a recording's folder, and opening a
pipe blocks until another process writes to it. Pipes of the shell, as ``<(command)``, are read.
"""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path
from typing import BinaryIO

_AT_ONCE = getattr(os, "O_NONBLOCK", 0)  # not on Windows
_OF_THE_SHELL = re.compile(r"/proc/\d+/fd/pipe:\[\d+\]")


def open_file(path: str | os.PathLike[str]) -> BinaryIO:
    """A file, open for reading.

    Raises:
        OSError: it cannot be opened, or is not a regular file.
    """
    return open(path, "rb", opener=open_regular)


def open_regular(path: str, flags: int) -> int:
    """The descriptor of a file, as an ``opener`` gives it; raises as `open_file`."""
    _check_kind(path, os.stat(path))  # before, since opening a device may do something
    descriptor = os.open(path, flags | _AT_ONCE)
    try:
        _check_kind(path, os.fstat(descriptor))  # again, since it may be another one by now
        if _AT_ONCE:
            os.set_blocking(descriptor, True)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def read_file(path: str | os.PathLike[str]) -> bytes:
    """The bytes of a file; raises as `open_file`."""
    with open_file(path) as file:
        return file.read()


def read_text(path: Path, encoding: str = "utf-8") -> str:
    """A file's text, with U+FFFD for invalid bytes; raises as `open_file`."""
    return read_file(path).decode(encoding, "replace")


def natural(file: Path) -> list[tuple[int, str]]:
    """Key that orders ``bag_10`` after ``bag_9``."""
    parts = re.split(r"(\d+)", file.name)
    return [(int(part), "") if part.isdecimal() else (0, part) for part in parts]


def is_of_the_shell(path: str | os.PathLike[str]) -> bool:
    """True for a pipe that the shell opened, which can be read once."""
    return _OF_THE_SHELL.fullmatch(os.path.realpath(path)) is not None


def _check_kind(path: str, about: os.stat_result) -> None:
    is_known = stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)  # `open` reports folders
    if not is_known and not is_of_the_shell(path):
        raise OSError(errno.EINVAL, "not a regular file", path)
