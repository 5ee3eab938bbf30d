"""The file that a recording is written to: opened with care, and readable after a failed write."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from ros_visualise.errors import OpenError, RecordingError

RESERVE = 64 * 1024
"""Bytes that stay free on a disk that fills up, so that a recording can be finished."""

DISK_FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class TargetFile:
    """A new file whose whole parts outlive a write that fails.

    The writer calls `keep` where what it has written so far can be read. `fail` cuts the file off
    there; from then on it swallows what it is given, so that a library that still wants to finish
    its file does no harm.

    Raises:
        OpenError: it exists and is not to be replaced, or it cannot be written.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "not a file"
            raise OpenError(f"{path}: is {kind}; give the name of a file to record to")
        try:
            self._file = path.open("wb" if overwrite else "xb", buffering=0)
        except FileExistsError:
            raise already_there(path) from None
        except FileNotFoundError:
            raise no_folder(path) from None
        except OSError as error:
            raise OpenError(f"{path}: cannot be written: {error.strerror}") from None
        self.path = path
        self.failed = False
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

    def has_room(self, size: int) -> bool:
        """Whether so many bytes can be written, and the end of the file after them."""
        return shutil.disk_usage(self.path.parent).free >= size + RESERVE

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

    def close(self) -> None:
        """Close it."""
        self._file.close()

    def remove(self) -> None:
        """Close it and delete it."""
        self._file.close()
        self.path.unlink(missing_ok=True)


def already_there(path: Path) -> OpenError:
    """What to tell where something exists that is not to be replaced."""
    return OpenError(f"{path} exists; add --overwrite or choose another name")


def no_folder(path: Path) -> OpenError:
    """What to tell where the folder lacks that something is to be written to."""
    return OpenError(f"{path}: there is no folder {path.parent}; create it first")


def recording_failed(path: Path, error: Exception, kept: int) -> RecordingError:
    """What to tell when a recording ends early."""
    reason = getattr(error, "strerror", None) or str(error)
    return RecordingError(f"{path}: {reason}; the first {kept} messages were kept")
