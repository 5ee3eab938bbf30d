"""The files that can be opened from the page."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import without_secrets
from ros_visualise.sources.formats import VIDEOS, suffixes
from ros_visualise.sources.opening import is_recorded_folder

SUFFIXES = (*suffixes(), *VIDEOS)
"""Suffixes of files that can be opened."""
_MOST = 500  # files of a folder that are offered
_MOST_RECENT = 10
_STREAM = re.compile(r"(rtsps?|rtmp|https?|udp|srt|wss?)://\S+|/dev/video\d{1,3}|test")
"""Addresses that may be opened: URLs of streams and servers, devices and the test pattern."""


class Wanted(NamedTuple):
    """A file or a stream to open, in place of what is played or beside it."""

    what: Path | str
    adds: bool


class FileChooser:
    """The videos and recordings in two folders, and the one to open next.

    Args:
        folder: that of the present file.
        uploads: that of the page's recordings and uploads.

    Attributes:
        current: the present file or stream, or None.
        more: files that are played with it.
        recent: files and devices that were opened, the newest first.
    """

    def __init__(self, folder: Path, uploads: Path, current: Path | None = None) -> None:
        self._folders = [folder] if _is_same(folder, uploads) else [folder, uploads]
        self.current: Path | str | None = current
        self.recent: list[str] = [] if current is None else [str(current)]
        self.more: list[Path] = []
        self._asked: Wanted | None = None

    def files(self) -> dict[str, Path]:
        """Files that can be opened: name -> path; of a name in both folders, the second in full."""
        there: dict[str, Path] = {}
        for folder in self._folders:
            names = {path.name: path for path in _openable(folder)}
            there |= {str(path) if name in there else name: path for name, path in names.items()}
        return there

    @property
    def title(self) -> str:
        """The names of what is played; empty without any."""
        if self.current is None:
            return ""
        # the name of a stream is not its address, which may hold a password
        first = self.current.name if isinstance(self.current, Path) else "camera"
        return ", ".join([first, *(path.name for path in self.more)])

    def ask(self, path: Path, adds: bool = False) -> None:
        """Open this next, or add it; raises UsageError if it is none of these files."""
        folder = next((one for one in self._folders if _is_same(one, path.parent)), None)
        if folder is None or not _is_openable(path) or not path.exists():
            raise UsageError(f"{path}: cannot be opened; choose another file")
        self._ask(folder / path.name, adds)

    def ask_for(self, text: str, adds: bool = False) -> None:
        """Open the file of this name, or a stream, next; raises as `ask`."""
        if not _STREAM.fullmatch(text):
            self.ask(self.files().get(text, Path(text)), adds)
        elif adds:
            raise UsageError(f"{text}: only recordings and videos can be added")
        else:
            self._ask(text)

    def _ask(self, what: Path | str, adds: bool = False) -> None:
        self._asked = Wanted(what, adds)
        if without_secrets(str(what)) == str(what):  # others see them
            self.recent = list(dict.fromkeys([str(what), *self.recent]))[:_MOST_RECENT]

    def take(self) -> Wanted | None:
        """The file or stream to open, once; None without any."""
        asked, self._asked = self._asked, None
        return asked

    def opened(self, wanted: Wanted) -> None:
        """Note that it is played."""
        if isinstance(wanted.what, Path) and wanted.adds:
            self.more.append(wanted.what)
        else:
            self.current, self.more = wanted.what, []


def _openable(folder: Path) -> list[Path]:
    """Videos and recordings in a folder, which may be folders too."""
    try:
        found = sorted(path for path in folder.iterdir() if _is_openable(path))
    except OSError:  # removed, or unreadable
        return []
    return found[:_MOST]


def _is_openable(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    is_named = path.suffix.lower() in SUFFIXES and (path.is_file() or path.is_dir())
    return is_named or is_recorded_folder(path)


def _is_same(one: Path, other: Path) -> bool:
    return one.absolute().resolve() == other.absolute().resolve()
