"""Names of files that are chosen remotely: plain names, in one folder.

The person who starts a process may name any file. A page, and the parameters of a running node, may
name those in one folder, and replace none of them without ``--overwrite``.
"""

from __future__ import annotations

import os
import unicodedata
from pathlib import Path

from ros_visualise.core.errors import UsageError

_MOST_BYTES = 200  # of a name; file systems allow 255
_INVISIBLE = (
    *((0x034F, 0x034F), (0x115F, 0x1160), (0x17B4, 0x17B5), (0x180B, 0x180F), (0x2800, 0x2800)),
    *((0x3164, 0x3164), (0xFE00, 0xFE0F), (0xFFA0, 0xFFA0), (0xE0100, 0xE01EF)),
)
"""Ranges (first, last) of letters and marks that are invisible by themselves."""
_folder, _may_replace = Path(), False


def set_folder(folder: Path, overwrite: bool = False) -> None:
    """Set the folder of files that may be named remotely, and if they may be replaced."""
    global _folder, _may_replace
    _folder, _may_replace = folder, overwrite


def given_folder() -> Path:
    """The folder of files that may be named remotely; by default the current one."""
    return _folder


def may_replace() -> bool:
    """True if existing files may be replaced."""
    return _may_replace


def inside(folder: Path, name: str) -> Path:
    """A file in a folder, by a plain name that was chosen remotely.

    Raises:
        UsageError: not a plain name, one that looks like another, or a link out of the folder.
    """
    size = len(name.encode(errors="replace"))
    if size > _MOST_BYTES:
        raise UsageError(f"the name has {size} bytes; choose one of at most {_MOST_BYTES}")
    check_printable(name)
    if any(map(_is_invisible, name)):
        raise UsageError(f"{name!a}: contains invisible characters; choose another name")
    if name.startswith(".") or "\\" in name or Path(name).name != name or not name:
        raise UsageError(f"{name!r}: give a plain name, without folders or a leading dot")
    path = folder / name
    if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
        raise UsageError(
            f"{name!r}: a symbolic link to a place outside the folder; choose another name"
        )
    return path


def check_printable(path: str | Path) -> None:
    """Refuse a name that cannot be shown on a line.

    Raises:
        UsageError: it contains control characters, or bytes that are not UTF-8.
    """
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in str(path)):
        raise UsageError(f"{str(path)!r}: contains control characters; choose another name")


def _is_invisible(letter: str) -> bool:
    """True if a character is invisible, or reverses the order of others."""
    is_mark = any(first <= ord(letter) <= last for first, last in _INVISIBLE)
    return is_mark or unicodedata.category(letter) in ("Cf", "Zl", "Zp")
