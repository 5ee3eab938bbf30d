"""Files that a browser sends: into one folder, by their names, and no larger than said."""

from __future__ import annotations

import asyncio
import logging
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ros_visualise.core.errors import RecordingError, RosVisualiseError, UsageError
from ros_visualise.core.limits import disk_reserve
from ros_visualise.core.paths import inside
from ros_visualise.ui.look.answers import Question, Refusal
from ros_visualise.ui.page.gate import UPLOAD, Receive
from ros_visualise.ui.page.incoming import Incoming
from ros_visualise.ui.page.pool import Pool
from ros_visualise.ui.shelf import SUFFIXES

log = logging.getLogger(__name__)

MAX_GIB, MAX_TOTAL_GIB = 8, 32
"""Maximum size of one upload, and of all those of a run that are still there."""
_MOST = 4  # at once
_IDLE_S = 30.0


class Uploads:
    """Takes in files; its calls come from the server's loop.

    Args:
        folder: where all of them go.
        ask: called with the file that is to be opened then.
        idle_s: how long a browser may send nothing.
        total: bytes, the most of all uploads that are still there.
    """

    def __init__(
        self,
        folder: Path,
        ask: Callable[[Path], None],
        idle_s: float = _IDLE_S,
        total: int = MAX_TOTAL_GIB << 30,
    ) -> None:
        self.folder, self._ask, self._idle_s, self._total = folder, ask, idle_s, total
        self._incoming: list[Incoming] = []
        self._taken: list[Path] = []
        self._writing = Pool("page uploads", 2)

    @property
    def state(self) -> str:
        """How far the present uploads are, in words; empty if there are none."""
        return ", ".join(f"{one.path.name}: {one.percent} %" for one in list(self._incoming))

    async def take(self, question: Question, receive: Receive) -> None:
        """Take in the file of which a question tells the name and the size.

        With ``open`` in it, that file is opened when this one is there.
        """
        try:
            incoming = self._begin(question)
            self._incoming.append(incoming)
            try:
                await self._write(incoming, receive)
            finally:
                self._incoming.remove(incoming)
            if question.text("open"):
                self._ask(inside(self.folder, question.text("open")))
        except (RosVisualiseError, Refusal) as error:
            log.warning("not uploaded: %s", error)

    def close(self) -> None:
        """End the threads."""
        self._writing.close()

    def _begin(self, question: Question) -> Incoming:
        """The new file.

        Raises:
            UsageError: it is not taken.
            RecordingError: it cannot be written.
        """
        name, size = question.text(UPLOAD), question.whole("size") or 0
        path = inside(self.folder, name)
        if path.suffix.lower() not in SUFFIXES:
            raise UsageError(f"{path.name}: give a file that ends in one of {' '.join(SUFFIXES)}")
        if not 0 < size <= MAX_GIB << 30:
            raise UsageError(f"{path.name}: give a file of 1 byte to {MAX_GIB} GiB")
        if any(one.path == path for one in self._incoming):
            raise UsageError(f"{path.name}: is being uploaded already; choose another name")
        if len(self._incoming) >= _MOST:
            raise UsageError(f"{path.name}: wait until one of {_MOST} uploads has ended")
        self._require_room(path.name, size)
        return Incoming(path, size)

    def _require_room(self, name: str, size: int) -> None:
        there = sum(path.stat().st_size for path in self._taken if path.is_file())
        if there + sum(one.size for one in self._incoming) + size > self._total:
            gib = self._total / 2**30
            raise UsageError(f"{name}: uploads may take {gib:.3g} GiB in all; delete some of them")
        disk = shutil.disk_usage(self.folder)
        reserve, words = disk_reserve(disk.total)
        if disk.free < sum(one.missing for one in self._incoming) + size + reserve:
            raise RecordingError(f"{name}: its disk would have less than {words} left")

    async def _write(self, incoming: Incoming, receive: Receive) -> None:
        """All of it, or nothing is left of it.

        Raises:
            RecordingError: it did not come to its end.
        """
        try:
            while incoming.missing:
                data = await asyncio.wait_for(receive(), self._idle_s)
                await self._writing.do(partial(incoming.write, data))
            await self._writing.do(incoming.finish)
        except BaseException as error:  # also of a browser that has gone, and at the end
            incoming.discard()
            if isinstance(error, Exception):
                reason = self._reason(error)
                raise RecordingError(f"{incoming.path}: {reason}; nothing was kept") from None
            raise
        self._taken.append(incoming.path)

    def _reason(self, error: Exception) -> str:
        if isinstance(error, asyncio.TimeoutError):
            return f"nothing came for {self._idle_s:g} s"
        if isinstance(error, OSError):
            return error.strerror or str(error)
        return "the browser was closed before the end"
