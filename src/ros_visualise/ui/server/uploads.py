"""Files that a browser sends: into one folder, by plain names, up to a size."""

from __future__ import annotations

import asyncio
import logging
import os
import secrets
import shutil
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from ros_visualise.core.errors import RecordingError, RosVisualiseError, UsageError
from ros_visualise.core.limits import disk_reserve
from ros_visualise.core.paths import inside
from ros_visualise.ui.file_chooser import SUFFIXES
from ros_visualise.ui.server.answers import BrowserQuery, Refusal
from ros_visualise.ui.server.pool import Pool

log = logging.getLogger(__name__)

Pieces = Callable[[], Awaitable[str | bytes]]
"""Gives the next piece of a file, or raises where the connection has ended."""
UPLOAD = "upload"
"""The parameter of queries whose connections send a file."""
MAX_GIB, MAX_TOTAL_GIB = 8, 32
"""Maximum size of one upload, and of all those of a run that are still there."""
_MOST = 4  # at once
_IDLE_S = 30.0


class Uploads:
    """Receives files; its calls come from the server's loop.

    Args:
        folder: the folder for all of them.
        ask: called with the file to open next.
        idle_s: for how long a browser may be silent.
        total: maximum bytes of all uploads that still exist.
    """

    def __init__(
        self,
        folder: Path,
        ask: Callable[[Path], None],
        idle_s: float = _IDLE_S,
        total: int = MAX_TOTAL_GIB << 30,
    ) -> None:
        self.folder, self._ask, self._idle_s, self._total = folder, ask, idle_s, total
        self._incoming: list[UploadedFile] = []
        self._taken: list[Path] = []
        self._writing = Pool("page uploads", 2)

    @property
    def state(self) -> str:
        """Progress of the present uploads, in words."""
        return ", ".join(f"{one.path.name}: {one.percent} %" for one in list(self._incoming))

    async def take(self, query: BrowserQuery, receive: Pieces) -> None:
        """Receive the file whose name and size a query gives; then open the one named ``open``."""
        try:
            incoming = self._begin(query)
            self._incoming.append(incoming)
            try:
                await self._write(incoming, receive)
            finally:
                self._incoming.remove(incoming)
            if query.text("open"):
                self._ask(inside(self.folder, query.text("open")))
        except (RosVisualiseError, Refusal) as error:
            log.warning("upload failed: %s", error)

    def close(self) -> None:
        self._writing.close()

    def _begin(self, query: BrowserQuery) -> UploadedFile:
        """The new file; raises UsageError or RecordingError if it is not accepted."""
        name, size = query.text(UPLOAD), query.whole("size") or 0
        path = inside(self.folder, name)
        if path.suffix.lower() not in SUFFIXES:
            raise UsageError(f"{path.name}: give a file that ends in one of {' '.join(SUFFIXES)}")
        if not 0 < size <= MAX_GIB << 30:
            raise UsageError(
                f"{path.name}: the file must be between 1 byte and {MAX_GIB} GiB in size"
            )
        if any(one.path == path for one in self._incoming):
            raise UsageError(f"{path.name}: already being uploaded; choose another name")
        if len(self._incoming) >= _MOST:
            raise UsageError(f"{path.name}: {_MOST} uploads are running; wait until one has ended")
        self._require_room(path.name, size)
        return UploadedFile(path, size)

    def _require_room(self, name: str, size: int) -> None:
        there = sum(path.stat().st_size for path in self._taken if path.is_file())
        if there + sum(one.size for one in self._incoming) + size > self._total:
            gib = self._total / 2**30
            raise UsageError(f"{name}: uploads are limited to {gib:.3g} GiB in all; delete some")
        disk = shutil.disk_usage(self.folder)
        reserve, words = disk_reserve(disk.total)
        if disk.free < sum(one.missing for one in self._incoming) + size + reserve:
            raise RecordingError(f"{name}: less than {words} of disk space would be left")

    async def _write(self, incoming: UploadedFile, receive: Pieces) -> None:
        """Receive all of a file, or raise RecordingError and remove it."""
        try:
            while incoming.missing:
                data = await asyncio.wait_for(receive(), self._idle_s)
                await self._writing.do(partial(incoming.write, data))
            await self._writing.do(incoming.finish)
        except BaseException as error:  # also as the connection is lost, and at shutdown
            incoming.discard()
            if isinstance(error, Exception):
                reason = self._reason(error)
                raise RecordingError(f"{incoming.path}: {reason}; partial file removed") from None
            raise
        self._taken.append(incoming.path)

    def _reason(self, error: Exception) -> str:
        if isinstance(error, asyncio.TimeoutError):
            return f"no data for {self._idle_s:g} s"
        if isinstance(error, OSError):
            return error.strerror or str(error)
        return "connection closed before the upload was complete"


class UploadedFile:
    """A new file, named ``NAME.....part`` until `finish`; ``missing`` counts the bytes to come.

    Raises:
        RecordingError: the name is taken, or it cannot be written.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size, self.missing = path, size, size
        self._part = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")
        try:
            if os.path.lexists(path):
                raise FileExistsError(0, _EXISTS)
            self._file = self._part.open("xb", buffering=0)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror}") from None

    @property
    def percent(self) -> int:
        return 100 * (self.size - self.missing) // self.size

    def write(self, data: str | bytes) -> None:
        """Append a piece; raises OSError if it cannot be written or exceeds the announced size."""
        if not data or isinstance(data, str) or len(data) > self.missing:
            raise OSError("size differs from the declared one")
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self.missing -= len(data)

    def finish(self) -> None:
        """Give the complete file its name; raises OSError if that is taken or cannot be written."""
        os.fsync(self._file.fileno())
        self._file.close()
        try:
            self.path.open("xb").close()  # nothing is replaced
        except FileExistsError:
            raise OSError(_EXISTS) from None
        try:
            os.replace(self._part, self.path)
        except OSError:
            self.path.unlink()
            raise

    def discard(self) -> None:
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            self._part.unlink()


_EXISTS = "exists; choose another name"
