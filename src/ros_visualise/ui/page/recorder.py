"""The switch for recording, the choice of what is recorded, and the way to have it."""

from __future__ import annotations

import shutil
import time
from datetime import datetime
from html import escape
from pathlib import Path

import viser

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import inside
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.ordering import recordable
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.sinks.parts import parse_split, part_path
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.files import Files
from ros_visualise.ui.page.worker import Worker

_START, _STOP = "● record", "■ stop recording"
_ALL, _NO = "all", "none"


class Recorder:
    """A name, a split, topics, a button, the recording's state and links, in the present container.

    Anybody on the page may choose the name, so the file stays in one folder, and nothing there is
    replaced. One recording runs at a time; it ends before the disk is full.
    """

    def __init__(self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, files: Files) -> None:
        self._runtime, self._files, self._folder = runtime, files, files.folder
        self._recording: RecorderThread | None = None
        self._series: Path | None = None  # the name that those of several files are made of
        self._begun_s = 0.0
        self._name = gui.add_text("file", _new_name(), hint="run.mcap, or edges.mp4")
        self._split = gui.add_text("split", "", hint="another file after 1G, or 10m; empty: never")
        self._topics = _Topics(gui, worker)
        self._topics.follow(runtime.graph)
        self._button = gui.add_button(_START)
        self._note = gui.add_html("", visible=False)
        self._links = gui.add_html("")
        self._show_links()
        self._button.on_click(worker.listener("record", self._press))

    def follow(self, graph: Graph) -> None:
        """Offer the topics of this graph from now on."""
        self._topics.follow(graph)

    def close(self) -> None:
        """The run has ended, and with it the recording."""
        if self._recording is not None:
            self._offer(self._recording)

    def refresh(self) -> None:
        """Show the state of the recording.

        Raises:
            RecordingError: it could not go on and has ended.
        """
        recording = self._recording
        if recording is None:
            return
        self._show(recording)
        if recording.error is not None:
            self._stop(recording)
            raise recording.error

    def _press(self, _: bool) -> None:
        if self._recording is not None:
            self._stop(self._recording)
            return
        path = inside(self._folder, self._name.value)
        split = parse_split(self._split.value) if self._split.value else None
        topics = self._topics.chosen
        self._recording = self._runtime.start_recording(path, topics=topics, split=split)
        self._series = path if split and path.suffix else None
        self._begun_s = time.monotonic()
        self._button.label, self._button.color = _STOP, "red"
        self._show(self._recording)

    def _show(self, recording: RecorderThread) -> None:
        dropped = f", {recording.dropped} dropped" if recording.dropped else ""
        dropped += f" ({recording.refused} refused)" if recording.refused else ""
        files = f" in {recording.files} files" if recording.files > 1 else ""
        state = f"{recording.path}: {recording.written} messages{files}{dropped}"
        state += self._room(recording)
        self._note.content = f'<div class="rv-note">{escape(state)}</div>'
        self._note.visible = True

    def _room(self, recording: RecorderThread) -> str:
        """How large it is, and how long the disk has room for more."""
        try:
            size = sum(map(_size, self._paths(recording)))
            free = shutil.disk_usage(self._folder).free
        except OSError:  # it is being renamed or removed
            return ""
        per_s = size / max(time.monotonic() - self._begun_s, 1.0)
        left = f", room for {_span(free / per_s)} more" if per_s else ""
        return f", {size / 1e6:.1f} MB{left} in {self._folder.absolute()}"

    def _stop(self, recording: RecorderThread) -> None:
        self._runtime.stop_recording(recording)
        self._show(recording)
        self._recording = None
        self._offer(recording)
        self._show_links()
        set_value(self._name, _new_name())
        self._button.label, self._button.color = _START, None

    def _offer(self, recording: RecorderThread) -> None:
        for path in self._paths(recording):
            self._files.recorded(path)

    def _paths(self, recording: RecorderThread) -> list[Path]:
        """Its files by now, or its folder."""
        if self._series is None:
            return [recording.path]
        return [part_path(self._series, number) for number in range(recording.files)]

    def _show_links(self) -> None:
        links = self._files.links
        text = f'<div class="rv-note rv-links">download: {links}</div>' if links else ""
        self._links.content = text


class _Topics:
    """A switch for each topic; at first they say what is recorded where nobody chooses."""

    def __init__(self, gui: viser.GuiApi, worker: Worker) -> None:
        self._gui = gui
        self._switches: dict[str, viser.GuiCheckboxHandle] = {}
        self._usual: set[str] = set()
        self._folder = gui.add_folder("what is recorded", expand_by_default=False)
        with self._folder:
            buttons = gui.add_button_group("topics", (_ALL, _NO))
        buttons.on_click(worker.listener(None, self._set_all))

    def follow(self, graph: Graph) -> None:
        """Offer the topics of this graph."""
        there = recordable(graph)
        for name in self._switches.keys() - there.keys():
            self._switches.pop(name).remove()
        rare = {name for name, topic in graph.topics.items() if topic.on_demand}
        self._usual = there.keys() - rare
        with self._folder:
            for name in [name for name in there if name not in self._switches]:
                switch = self._gui.add_checkbox(name, name in self._usual)
                self._switches[name] = switch

    @property
    def chosen(self) -> tuple[str, ...]:
        """The topics to record; none for the usual ones.

        Raises:
            UsageError: there is none.
        """
        chosen = [name for name, switch in self._switches.items() if switch.value]
        if not chosen:
            raise UsageError("choose a topic to record")
        return () if set(chosen) == self._usual else tuple(chosen)

    def _set_all(self, label: str) -> None:
        for switch in self._switches.values():
            set_value(switch, label == _ALL)


def _size(path: Path) -> int:
    """Of a file, or of all in a folder; bytes."""
    files = [one for one in path.rglob("*") if one.is_file()] if path.is_dir() else [path]
    return sum(one.stat().st_size for one in files)


def _span(seconds: float) -> str:
    for unit, length in (("days", 86400), ("hours", 3600), ("minutes", 60)):
        if seconds > 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} seconds"


def _new_name() -> str:
    return f"record-{datetime.now():%Y%m%d-%H%M%S}.mcap"
