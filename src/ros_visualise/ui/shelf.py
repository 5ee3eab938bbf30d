"""The files of which a person may choose what is shown next."""

from __future__ import annotations

from pathlib import Path

from ros_visualise.core.errors import UsageError
from ros_visualise.sources.formats import suffixes
from ros_visualise.sources.opening import is_recorded_folder

VIDEOS = (".avi", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".ts", ".webm")
SUFFIXES = (*suffixes(), *VIDEOS)
"""How the names end of what can be opened."""
_MOST = 500  # files of a folder that are offered


class Shelf:
    """The videos and recordings in two folders, and the one that was asked for.

    Args:
        folder: the one of what is shown.
        uploads: the one that the page records and uploads to.

    Attributes:
        current: what is shown; None: no file.
    """

    def __init__(self, folder: Path, uploads: Path, current: Path | None = None) -> None:
        self._folders = [folder] if _is_same(folder, uploads) else [folder, uploads]
        self.current = current
        self._asked: Path | None = None

    def files(self) -> dict[str, Path]:
        """What can be opened: name -> path; what is in the second folder is named with it."""
        there: dict[str, Path] = {}
        for folder in self._folders:
            names = {path.name: path for path in _openable(folder)}
            there |= {str(path) if name in there else name: path for name, path in names.items()}
        return there

    def ask(self, path: Path) -> None:
        """Show this next.

        Raises:
            UsageError: it is none of these files.
        """
        folder = next((one for one in self._folders if _is_same(one, path.parent)), None)
        if folder is None or not _is_openable(path) or not path.exists():
            raise UsageError(f"{path}: is not there to be opened; choose another file")
        self._asked = folder / path.name

    def take(self) -> Path | None:
        """What was asked for since; None: nothing."""
        asked, self._asked = self._asked, None
        return asked


def _openable(folder: Path) -> list[Path]:
    """Videos and recordings in a folder, which may be folders too."""
    try:
        found = sorted(path for path in folder.iterdir() if _is_openable(path))
    except OSError:  # it was removed, or nobody may read it
        return []
    return found[:_MOST]


def _is_openable(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    is_named = path.suffix.lower() in SUFFIXES and (path.is_file() or path.is_dir())
    return is_named or is_recorded_folder(path)


def _is_same(one: Path, other: Path) -> bool:
    return one.absolute().resolve() == other.absolute().resolve()
