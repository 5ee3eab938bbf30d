"""Where something new is written to, and how it takes the place of what is there."""

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
    """A new file or folder; what is there under its name is replaced when the new one is whole.

    Where nothing is there, it is written under its own name, and is found there however it ends.
    Else it is written beside the old one, as NAME.part.SUFFIX, until `close`. Meanwhile its name is
    locked against other processes; the lock ends with this one, however that ends. Nobody may read
    or write it who might not the old one.

    Attributes:
        path: where it is.
        replaces: whether something was there.

    Raises:
        OpenError: as `check`, or somebody else is writing to that name.
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
        """Say what cannot be written, and touch nothing.

        Raises:
            OpenError: it is there and not to be replaced, or it cannot be written.
            UsageError: it is no name; see `ros_visualise.core.paths.check_printable`.
        """
        check_printable(path)
        if path.name in ("", ".."):
            raise UsageError(f"{path}: has no name of its own; give the name of a file or folder")
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
        """See that it is where it was begun.

        Raises:
            OSError: it is not.
        """
        if not self._is_there():
            raise OSError(errno.ENOENT, "it was moved or removed while it was written")

    def close(self, whole: bool = True) -> None:
        """End it; a whole one takes the place of what was there.

        Raises:
            OSError: it cannot: it is where it was written, or nowhere.
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
        """End it before it is whole.

        Args:
            error: why.
            kept: so many messages of it can be read; where there are none, it is removed.

        Returns:
            what to tell.
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
        """What to add where it ends early: what was there still is, if anything was."""
        return f"; {self._name} is as it was" if self.replaces else ""

    def remove(self) -> None:
        """End it and delete it; what was there still is."""
        self._held.close()
        if self._is_there():
            self._delete()

    @classmethod
    @abstractmethod
    def _check_old(cls, path: Path) -> None:
        """Raise OpenError unless what is there is of a kind that may be replaced."""

    @abstractmethod
    def _create(self, path: Path) -> Path:
        """Make it; raise FileExistsError where something is there."""

    @abstractmethod
    def _sync(self) -> None:
        """See that the disk has it."""

    @abstractmethod
    def _replace(self, old: Path) -> None:
        """Put it in the place of the old one."""

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
                log.warning("%s is left of an earlier run; delete it if you do not need it", path)
        raise AssertionError

    def _require_old(self) -> None:
        """See that nobody put another thing in the place of what is to be replaced."""
        if self._place.exists() and not os.path.samestat(self._old, self._place.stat()):
            raise OSError(errno.EEXIST, "something else has its name by now")

    def _is_there(self) -> bool:
        try:
            return os.path.samestat(self._made, self.path.stat())
        except OSError:
            return False


def sync(path: Path) -> None:
    """See that the disk has what was written to a file, or which files a folder has."""
    if sys.platform != "win32":  # which cannot open folders
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def take_over(new: Path, old: os.stat_result) -> None:
    """Give something new the owner and the rights of something old, as far as that can be done."""
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
    """What a link leads to, so that it is that which is written, and not the link."""
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
            raise OpenError(f"{path}: is being recorded already; choose another name")
        yield
    finally:
        os.close(descriptor)


def _not_written(path: Path, error: OSError) -> OpenError:
    if isinstance(error, FileExistsError):
        return OpenError(f"{path} exists; choose another name, or replace it with --overwrite")
    if isinstance(error, FileNotFoundError):
        return OpenError(f"{path}: there is no folder {path.parent}; create it first")
    return OpenError(f"{path}: cannot be written: {error.strerror}")
