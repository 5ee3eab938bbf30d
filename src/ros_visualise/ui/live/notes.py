"""Notes of a recording, which browsers read and write."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Annotated

import msgspec
from msgspec import Meta

from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.live.asked import Asked, understand
from ros_visualise.ui.live.board import LiveBoard, Visitor
from ros_visualise.ui.live.exchange import ignore
from ros_visualise.ui.live.marks import LONGEST_NOTES, Marks
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.worker import PageWorker

_PERIOD_S, _CLOSE_S = 1.0, 2.0


class WriteNotes(Asked, tag="write"):
    """Replace the notes. ``by``: a name that the browser gives its panel."""

    text: Annotated[str, Meta(max_length=LONGEST_NOTES)]
    by: Annotated[str, Meta(max_length=40)]


_DECODER = msgspec.json.Decoder(WriteNotes)


class NotesHub:
    """Serves the notes of what is shown to all browsers; the last one to write counts.

    Args:
        say: called with the reason of a failure, one line.
    """

    path = "/live/notes"

    def __init__(self, loop: asyncio.AbstractEventLoop, say: Callable[[str], None]) -> None:
        self._board = LiveBoard(loop)
        self._worker = PageWorker(say, lambda: None, _PERIOD_S)
        self.follow(Marks())

    def follow(self, marks: Marks) -> None:
        """Show the notes beside these marks from now on; from any thread."""
        self._marks = marks
        self._put("")
        self._worker.start()

    def show(self, runtime: Runtime | None) -> None:
        """Do nothing: notes belong to a file."""

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends requests, and gets lists of messages."""
        visit: Visit = scope["state"]["visit"]
        hear = ignore if visit.is_viewer else self._hear
        await self._board.serve(receive, send, Visitor(), hear)

    def close(self) -> None:
        """End its thread, after the present file is written."""
        self._worker.close(_CLOSE_S)

    def _hear(self, text: str) -> None:
        request = understand(_DECODER, text)
        if request is not None:
            self._worker.ask("write", partial(self._write, self._marks, request))

    def _write(self, marks: Marks, request: WriteNotes) -> None:
        try:
            marks.note(request.text)
        finally:
            self._put(request.by)

    def _put(self, by: str) -> None:
        path = self._marks.path
        kept = "" if path is None else path.name
        self._board.put("notes", {"text": self._marks.notes, "file": kept, "by": by})
