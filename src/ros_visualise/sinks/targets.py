"""New files and folders, which replace old ones when they are complete."""

from __future__ import annotations

import errno
import logging
import os
import stat
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from itertools import count
from pathlib import Path

from ros_visualise.core.errors import OpenError, RecordingError, UsageError
from ros_visualise.core.paths import check_printable

if sys.platform != "win32":
    import fcntl

log = logging.getLogger(__name__)


class Target(ABC):
    """A new file or folder; it replaces an old one of its name when it is complete.

    If there is no old one, it is written under its own name, and stays there however it ends. Else
    it is written beside the old one, as NAME.part.SUFFIX, until `close`. Meanwhile its name is
    locked against other processes; the lock ends with this process, however that ends. It never has
    wider permissions than the old one.

    Attributes:
        path: its current place.
        replaces: True if there is an old one.

    Raises:
        OpenError: as `check`, or another process is writing to that name.
        UsageError: as `check`.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        self.check(path, overwrite)
        self._name, self._place = path, _followed(path)
        self.replaces = overwrite and os.path.lexists(self._place)
        with ExitStack() as held:
            try:
                if self.replaces:
                    held.enter_context(_locked(self._place))
                    self._old = self._place.stat()
                self.path = self._create_beside() if self.replaces else self._create(self._place)
                self._made = self.path.stat()
                held.enter_context(_locked(self.path))
            except OSError as error:
                raise _not_written(path, error) from None
            self._held = held.pop_all()

    @classmethod
    def check(cls, path: Path, overwrite: bool) -> None:
        """Check that it can be written, without touching anything.

        Raises:
            OpenError: it exists already, or cannot be written.
            UsageError: not a valid name; see `ros_visualise.core.paths.check_printable`.
        """
        check_printable(path)
        if path.name in ("", ".."):
            raise UsageError(f"{path}: not a valid name; give the name of a file or folder")
        try:
            if path.parent.exists() and path.exists():
                cls._check_old(path)
        except OSError as error:
            raise _not_written(path, error) from None
        if os.path.lexists(path) and not overwrite:
            raise _not_written(path, FileExistsError())
        if not path.parent.exists():
            raise _not_written(path, FileNotFoundError())
        if path.exists() and not os.access(path, os.W_OK):
            raise _not_written(path, OSError(errno.EACCES, os.strerror(errno.EACCES)))

    def require_there(self) -> None:
        """Check that it was not moved or removed.

        Raises:
            OSError: it was.
        """
        if not self._is_there():
            raise OSError(errno.ENOENT, "moved or removed while it was being written")

    def close(self, whole: bool = True) -> None:
        """Finish it; a complete one replaces the old one.

        Raises:
            OSError: it could not replace it, or was removed.
        """
        with self._held:
            self.require_there()
            if whole and self.replaces:
                self._sync()
                self._require_old()
                self._replace(self._place)
                self.path = self._name
                with suppress(OSError):  # it is there; a folder that cannot be listed is not synced
                    sync(self._place.parent)

    def give_up(self, error: Exception, kept: int) -> RecordingError:
        """End it before it is complete.

        Args:
            error: the reason.
            kept: number of its messages that can be read; with 0, it is removed.

        Returns:
            the error to raise.
        """
        self._held.close()
        reason = getattr(error, "strerror", None) or str(error)
        if not self._is_there():
            return RecordingError(f"{self._name}: {reason}; nothing was kept")
        if not kept:
            with suppress(OSError):
                self.remove()
            return RecordingError(f"{self._name}: {reason}; nothing was kept{self.fate}")
        where = f" in {self.path}" if self.replaces else ""
        words = f"{self._name}: {reason}; the first {kept} messages were kept{where}{self.fate}"
        return RecordingError(words)

    @property
    def fate(self) -> str:
        """Note for messages about an early end: the old one is unchanged, if there is one."""
        return f"; {self._name} is unchanged" if self.replaces else ""

    def remove(self) -> None:
        """Delete it; an old one stays."""
        self._held.close()
        if self._is_there():
            self._delete()

    @classmethod
    @abstractmethod
    def _check_old(cls, path: Path) -> None:
        """Raise OpenError unless the old one is of a kind that may be replaced."""

    @abstractmethod
    def _create(self, path: Path) -> Path:
        """Create it; raise FileExistsError if the name is taken."""

    @abstractmethod
    def _sync(self) -> None:
        """Flush it to the disk."""

    @abstractmethod
    def _replace(self, old: Path) -> None:
        """Replace the old one."""

    @abstractmethod
    def _delete(self) -> None:
        """Delete it."""

    def _create_beside(self) -> Path:
        old = self._place
        for number in count(1):
            part = f".part{number if number > 1 else ''}"
            path = old.with_name(f"{old.stem}{part}{old.suffix}")
            try:
                return self._create(path)
            except FileExistsError:
                log.warning("%s is left over from an earlier run; delete it if not needed", path)
        raise AssertionError

    def _require_old(self) -> None:
        """Check that the old one is still the same."""
        if self._place.exists() and not os.path.samestat(self._old, self._place.stat()):
            raise OSError(errno.EEXIST, "the existing file or folder was replaced in the meantime")

    def _is_there(self) -> bool:
        try:
            return os.path.samestat(self._made, self.path.stat())
        except OSError:
            return False


def sync(path: Path) -> None:
    """Flush a file, or the list of files of a folder, to the disk."""
    if sys.platform != "win32":  # which cannot open folders
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def take_over(new: Path, old: os.stat_result) -> None:
    """Give a new file the owner and the permissions of an old one, as far as possible."""
    if sys.platform == "win32":
        return
    mode = stat.S_IMODE(old.st_mode)
    with suppress(OSError):
        os.chown(new, -1, old.st_gid)
    with suppress(OSError):
        os.chown(new, old.st_uid, -1)
    if new.stat().st_gid != old.st_gid:
        mode &= ~stat.S_IRWXG  # of another group
    with suppress(OSError):  # a file system without rights
        new.chmod(mode)


def _followed(path: Path) -> Path:
    """The target of a link, which is written in place of the link."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    if sys.platform == "win32":
        yield
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_free = os.path.samestat(os.fstat(descriptor), path.stat())
        except BlockingIOError:
            is_free = False
        except OSError as error:  # a file system without locks
            log.debug("%s: %s", path, error)
            is_free = True
        if not is_free:
            raise OpenError(f"{path}: another process is recording to it; choose another name")
        yield
    finally:
        os.close(descriptor)


def _not_written(path: Path, error: OSError) -> OpenError:
    if isinstance(error, FileExistsError):
        return OpenError(f"{path} exists; choose another name, or replace it with --overwrite")
    if isinstance(error, FileNotFoundError):
        return OpenError(f"{path}: no such folder: {path.parent}; create it first")
    return OpenError(f"{path}: cannot be written: {error.strerror}")
