"""Files for browsers: opened, recorded and saved."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import inside
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.ordering import recordable
from ros_visualise.runtime.saving import live_parameters, new_name, save, write_yaml
from ros_visualise.ui import Value
from ros_visualise.ui.file_chooser import SUFFIXES
from ros_visualise.ui.live.asked import Asked, Name, Text, understand
from ros_visualise.ui.live.board import LiveBoard, Visitor
from ros_visualise.ui.live.exchange import ignore
from ros_visualise.ui.live.exporter import PageExporter, exportable
from ros_visualise.ui.live.recorder import PageRecorder, usual_topics
from ros_visualise.ui.server.files import PageFiles
from ros_visualise.ui.server.gate import Receive, Scope, Send, Visit
from ros_visualise.ui.server.uploads import MAX_GIB
from ros_visualise.ui.worker import PageWorker

_PERIOD_S, _CLOSE_S = 0.2, 0.3
_OFTEN = 5  # ticks between two looks into the folders
_MOST = 5000  # topics


class Open(Asked, tag="open"):
    """Open one of the files that are offered, or a stream; or add a file to what is played."""

    name: Text
    add: bool = False


class Record(Asked, tag="record"):
    """Record topics; None is the usual ones."""

    name: Name = ""
    split: Name = ""
    topics: Annotated[list[Name], Meta(max_length=_MOST)] | None = None


class StopRecording(Asked, tag="stop"):
    """End the recording."""


class Save(Asked, tag="save"):
    """Save all parameters, or what differs from the beginning with the layout of the page."""

    what: Literal["parameters", "layout"]
    name: Name = ""
    layout: Annotated[str, Meta(max_length=20_000)] = ""


class Export(Asked, tag="export"):
    """Write the messages between two times to a new file; None is the end, and all topics."""

    start: Annotated[float, Meta(ge=0)]
    end: Annotated[float, Meta(ge=0)] | None = None
    name: Name = ""
    topics: Annotated[list[Name], Meta(max_length=_MOST)] | None = None


class StopExport(Asked, tag="stop_export"):
    """End the export early."""


_DECODER = msgspec.json.Decoder(Open | Record | StopRecording | Save | Export | StopExport)


class FilesHub:
    """Serves the files of a page to all browsers, and does what they ask.

    Args:
        say: called with the reason of a rejection, one line.
        settings: gives the settings that a layout file holds.
    """

    path = "/live/files"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        say: Callable[[str], None],
        files: PageFiles,
        settings: Callable[[], Mapping[str, Value]],
    ) -> None:
        self._say = say
        self._board, self._files, self._settings = LiveBoard(loop), files, settings
        self._runtime: Runtime | None = None
        self._recorder: PageRecorder | None = None
        self._exporter: PageExporter | None = None
        self._ticks = 0
        self._worker = PageWorker(say, self._tick, _PERIOD_S)

    def show(self, runtime: Runtime | None) -> None:
        """Offer to record the graph of this runtime from now on, or none; from any thread.

        The recording of an earlier one ends with it.
        """
        if self._recorder is not None:
            self._recorder.close()
        if self._exporter is not None:
            self._exporter.close(_CLOSE_S)
        self._runtime = runtime
        self._recorder = self._exporter = None
        if runtime is not None:
            folder, offer = self._files.folder, self._files.recorded
            self._recorder = PageRecorder(runtime, folder, offer)
            self._exporter = PageExporter(runtime, folder, offer, self._say)
        self._worker.start()

    async def serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one browser until it leaves: it sends requests, and gets lists of messages."""
        visit: Visit = scope["state"]["visit"]
        hear = ignore if visit.is_viewer else self._hear
        await self._board.serve(receive, send, Visitor(), hear)

    def close(self) -> None:
        """End its thread."""
        self._worker.close(_CLOSE_S)
        self.show(None)

    def _hear(self, text: str) -> None:
        request = understand(_DECODER, text)
        if isinstance(request, Open):
            self._worker.ask(object(), partial(self._open, request))
        elif isinstance(request, Save):
            self._worker.ask(object(), partial(self._save, request))
        elif isinstance(request, Export | StopExport):
            self._worker.ask(object(), partial(self._export, request))
        elif request is not None:
            self._worker.ask(object(), partial(self._record, request))

    def _open(self, request: Open) -> None:
        if self._files.chooser is None:
            raise UsageError("this page cannot open files")
        self._files.chooser.ask_for(request.name, request.add)

    def _record(self, request: Record | StopRecording) -> None:
        if self._recorder is None:
            return
        try:
            if isinstance(request, Record):
                self._recorder.start(request.name, request.split, request.topics)
            else:
                self._recorder.stop()
        finally:
            self._show_recording()

    def _export(self, request: Export | StopExport) -> None:
        if self._exporter is None:
            return
        try:
            if isinstance(request, Export):
                span_s = request.start, request.end
                self._exporter.start(request.name, span_s, request.topics or ())
            else:
                self._exporter.stop()
        finally:
            self._show_recording()

    def _save(self, request: Save) -> None:
        path = inside(self._files.folder, request.name or new_name(request.what))
        if request.what == "layout":
            layout = {"layout": request.layout} if request.layout else {}
            write_yaml({**layout, **self._settings()}, path)
        elif self._runtime is not None:
            save(live_parameters(self._runtime), path)
        self._board.put("saved", {"saved": str(path)})

    def _tick(self) -> None:
        self._ticks += 1
        try:
            if self._recorder is not None:
                self._recorder.refresh()
            if self._exporter is not None:
                self._exporter.refresh()
        finally:
            if self._board.is_watched:
                self._show_recording()
                if self._ticks % _OFTEN == 1:
                    self._show_files()

    def _show_recording(self) -> None:
        if self._recorder is not None:
            self._board.put("recording", self._recorder.state)
        if self._exporter is not None:
            self._board.put("export", self._exporter.state)
        self._board.put("links", {"links": self._files.names})
        uploads = self._files.uploads
        self._board.put("uploads", {"uploads": uploads.state if uploads else ""})

    def _show_files(self) -> None:
        """Show what can be opened and recorded."""
        chooser = self._files.chooser
        files = [] if chooser is None else list(chooser.files())
        recent = [] if chooser is None else chooser.recent
        folder = str(self._files.folder.absolute())
        message = {"files": files, "recent": recent, "folder": folder, "opens": chooser is not None}
        self._board.put("files", {**message, "suffixes": SUFFIXES, "gib": MAX_GIB})
        if self._runtime is not None:
            graph = self._runtime.graph
            usual = usual_topics(graph)
            topics = [[name, name in usual] for name in recordable(graph)]
            self._board.put("topics", {"topics": topics, "exportable": exportable(graph)})
