"""The file that a recording is written to: opened with care, and readable after a failed write."""

from __future__ import annotations

import errno
import io
import os
import shutil
from contextlib import suppress
from pathlib import Path

from ros_visualise.core.errors import OpenError
from ros_visualise.core.limits import disk_reserve
from ros_visualise.core.paths import may_replace
from ros_visualise.sinks.targets import Target, sync, take_over

_own: dict[Path, tuple[int, ...] | None] = {}
"""Files that `save_again` wrote: where they are, and what tells whether they are still the same."""
_RESERVE_BYTES = 64 * 1024
"""What stays free on a disk that fills up, so that a recording can be finished."""


class TargetFile(Target):
    """A new file whose whole parts outlive a write that fails.

    The writer calls `keep` where what it has written so far can be read. `fail` cuts the file off
    there; from then on it swallows what it is given, so that a library that still wants to finish
    its file does no harm.

    Args:
        path: its name.
        overwrite: whether it may be there.
        live: leave 1 GiB or 5% of the disk free, for what a running graph makes has no end.

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
        """As of any file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As of any file."""
        return self._file.tell()

    @property
    def size(self) -> int:
        """Bytes in it."""
        return os.fstat(self._file.fileno()).st_size

    def require_room(self, size: int) -> None:
        """See that so many bytes can be written, and the end of the file after them.

        Raises:
            OSError: they cannot.
        """
        self.require_there()
        disk = shutil.disk_usage(self.path.parent)
        if disk.free < size + _RESERVE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        reserve, words = disk_reserve(disk.total)
        if self._live and disk.free < size + reserve:
            raise OSError(errno.ENOSPC, f"its disk has less than {words} left")

    def keep(self) -> None:
        """What is written so far can be read as it is."""
        self._kept = self.size

    def cut(self, size: int) -> None:
        """Drop what comes after so many bytes, and go on there."""
        if not self.failed:
            self._kept = min(self._kept, size)
            self._file.seek(size)
            self._file.truncate()

    def fail(self) -> None:
        """Drop what was written after the last `keep`, and all that comes."""
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
        """To its owner alone, until it has the rights of what it replaces."""
        return os.open(path, flags, 0o600 if self.replaces else 0o666)

    def _sync(self) -> None:
        sync(self.path)

    def _replace(self, old: Path) -> None:
        os.replace(self.path, old)

    def _delete(self) -> None:
        self.path.unlink()


def write_file(path: Path, data: bytes, overwrite: bool = False) -> None:
    """Write a whole file, or nothing.

    Raises:
        OpenError: it is there and not to be replaced, or it cannot be written.
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
    """Write a file that a running node is asked for, maybe more than once; raises as `write_file`.

    It replaces what this process wrote there and nobody changed since; else only what
    `ros_visualise.core.paths.may_replace` allows.
    """
    place = Path(os.path.realpath(path))
    write_file(path, data, may_replace() or _own.get(place, ()) == _identity(place))
    _own[place] = _identity(place)


def _identity(path: Path) -> tuple[int, ...] | None:
    """What changes whenever a file is replaced or written; None where there is none."""
    with suppress(OSError):
        about = path.stat()
        return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
    return None
