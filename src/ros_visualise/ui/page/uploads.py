"""Files that a browser sends: into one folder, by their names, and no larger than said."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from pathlib import Path

from ros_visualise.errors import RosVisualiseError, UsageError
from ros_visualise.paths import inside
from ros_visualise.sinks.files import TargetFile
from ros_visualise.ui.look.answers import Question, Refusal
from ros_visualise.ui.shelf import SUFFIXES

log = logging.getLogger(__name__)

MAX_GIB = 8
"""Of one upload."""
Receive = Callable[[], Awaitable[str | bytes]]
"""Gives the next piece of what a browser sends, or raises where it has gone."""


class Uploads:
    """Takes in one file at a time; its calls come from the server's loop.

    Args:
        folder: where all of them go.
        ask: called with the file that is to be opened then.

    Attributes:
        state: of the present upload, in words; empty: there is none.
    """

    def __init__(self, folder: Path, ask: Callable[[Path], None]) -> None:
        self.folder, self._ask = folder, ask
        self.state = ""

    async def take(self, question: Question, receive: Receive) -> None:
        """Take in the file of which a question tells the name and the size.

        With ``open`` in it, that file is opened when this one is there.
        """
        try:
            target, size = self._begin(question)
            self.state = f"{target.path.name}: 0 %"
            try:
                await self._write(target, size, receive)
            finally:
                self.state = ""
            if question.text("open"):
                self._ask(inside(self.folder, question.text("open")))
        except (RosVisualiseError, Refusal) as error:
            log.warning("not uploaded: %s", error)

    def _begin(self, question: Question) -> tuple[TargetFile, int]:
        """The new file, and its size.

        Raises:
            OpenError: it is there already, or the disk is full.
            UsageError: no such file is taken.
        """
        name, size = question.text("upload"), question.whole("size") or 0
        path = inside(self.folder, name)
        if path.suffix.lower() not in SUFFIXES:
            raise UsageError(f"{path.name}: give a file that ends in one of {' '.join(SUFFIXES)}")
        if not 0 < size <= MAX_GIB << 30:
            raise UsageError(f"{path.name}: give a file of 1 byte to {MAX_GIB} GiB")
        if self.state:
            raise UsageError(f"{path.name}: wait until the present upload has ended")
        target = TargetFile(path, overwrite=False, live=True)
        try:
            target.require_room(size)
        except OSError as error:
            raise target.give_up(error, 0) from None
        return target, size

    async def _write(self, target: TargetFile, size: int, receive: Receive) -> None:
        """All of it, or nothing is left of it.

        Raises:
            RecordingError: it did not come to its end.
        """
        written = 0
        try:
            while written < size:
                data = await receive()
                if isinstance(data, str) or written + len(data) > size:
                    raise OSError("it is not the file that was announced")
                written += await asyncio.to_thread(target.write, data)
                self.state = f"{target.path.name}: {100 * written // size} %"
            target.close()
        except BaseException as error:  # also of a browser that has gone, and at the end
            failed = target.give_up(error if isinstance(error, OSError) else _Gone(), 0)
            if isinstance(error, Exception):
                raise failed from None
            raise


class _Gone(Exception):
    def __str__(self) -> str:
        return "the browser was closed before the end"
