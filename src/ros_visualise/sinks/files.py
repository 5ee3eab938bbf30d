"""The file that a recording is written to: opened with care, and readable after a failed write."""

from __future__ import annotations

import errno
import io
import os
import shutil
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import disk_reserve
from ros_visualise.core.paths import may_replace
from ros_visualise.sinks.names import check_targets
from ros_visualise.sinks.targets import Target, sync, take_over

_own: dict[Path, tuple[int, ...] | None] = {}
"""Files that `save_again` wrote -> their identity at that time."""
_RESERVE_BYTES = 64 * 1024
"""Space left free on a full disk, so that a recording can be finished."""


class TargetFile(Target):
    """A new file whose complete parts outlive a failed write.

    The writer calls `keep` where the file can be read so far. `fail` truncates the file there and
    ignores later writes, so that a library may still finish its file.

    Args:
        path: its name.
        overwrite: replace an existing file.
        live: leave 1 GiB or 5% of the disk free, as a running graph never ends by itself.

    Raises:
        OpenError: as `Target`.
    """

    def __init__(self, path: Path, overwrite: bool, live: bool = False) -> None:
        super().__init__(path, overwrite)
        self._held.callback(self._file.close)
        self.failed = False
        self._live = live
        self._kept = 0

    def write(self, data: bytes | memoryview) -> int:
        """Write all of it.

        Raises:
            OSError: not all of it could be written.
        """
        rest = memoryview(data)
        while rest and not self.failed:
            rest = rest[self._file.write(rest) :]
        return len(data)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """See `io.IOBase`."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """See `io.IOBase`."""
        return self._file.tell()

    @property
    def size(self) -> int:
        """Bytes in it."""
        return os.fstat(self._file.fileno()).st_size

    def require_room(self, size: int) -> None:
        """Check that so many bytes can be written, and the end of the file after them.

        Raises:
            OSError: no space left.
        """
        self.require_there()
        disk = shutil.disk_usage(self.path.parent)
        if disk.free < size + _RESERVE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        reserve, words = disk_reserve(disk.total)
        if self._live and disk.free < size + reserve:
            raise OSError(errno.ENOSPC, f"its disk has less than {words} left")

    def keep(self) -> None:
        """Note that the file can be read up to here."""
        self._kept = self.size

    def cut(self, size: int) -> None:
        """Truncate the file to so many bytes, and continue there."""
        if not self.failed:
            self._kept = min(self._kept, size)
            self._file.seek(size)
            self._file.truncate()

    def fail(self) -> None:
        """Truncate the file to the last `keep`, and ignore later writes."""
        self.failed = True
        self._file.truncate(self._kept)

    @classmethod
    def _check_old(cls, path: Path) -> None:
        if not path.is_file():
            kind = "a folder" if path.is_dir() else "not a file"
            raise OpenError(f"{path}: is {kind}; give the name of a file to write to")

    def _create(self, path: Path) -> Path:
        self._file = io.FileIO(path, "x", opener=self._open)
        if self.replaces:
            take_over(path, self._old)
        return path

    def _open(self, path: str, flags: int) -> int:
        """Open it for its owner only, until it takes over the permissions of the old file."""
        return os.open(path, flags, 0o600 if self.replaces else 0o666)

    def _sync(self) -> None:
        sync(self.path)

    def _replace(self, old: Path) -> None:
        os.replace(self.path, old)

    def _delete(self) -> None:
        self.path.unlink()


def check_new(files: Iterable[Path | None], overwrite: bool, *sources: str | Path | None) -> None:
    """Reject files, of those that are given, that could not be written later.

    Args:
        files: to write; None: not given.
        overwrite: existing ones may be replaced.
        sources: what is read.

    Raises:
        OpenError, UsageError: as `Target.check` and `check_targets`.
    """
    given = [one for one in files if one is not None]
    check_targets(given, *sources)
    for one in given:
        TargetFile.check(one, overwrite)


def write_file(path: Path, data: bytes, overwrite: bool = False) -> None:
    """Write a whole file, or nothing.

    Raises:
        OpenError: it exists already, or cannot be written.
        RecordingError: it could not be written to its end.
    """
    target = TargetFile(path, overwrite)
    try:
        target.require_room(len(data))
        target.write(data)
        target.close()
    except OSError as error:
        raise target.give_up(error, 0) from None


def save_again(path: Path, data: bytes) -> None:
    """Write a file that a running node may save more than once; raises as `write_file`.

    It replaces a file that this process wrote, unless it was changed since; other files only if
    `ros_visualise.core.paths.may_replace` allows it.
    """
    place = Path(os.path.realpath(path))
    write_file(path, data, may_replace() or _own.get(place, ()) == _identity(place))
    _own[place] = _identity(place)


def _identity(path: Path) -> tuple[int, ...] | None:
    """Properties that change whenever a file is replaced or written; None if it is missing."""
    with suppress(OSError):
        about = path.stat()
        return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
    return None
