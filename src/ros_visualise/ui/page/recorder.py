"""The panel that records topics, and saves parameters and the layout."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import viser

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import inside
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.ordering import recordable
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.saving import live_parameters, new_name, save, write_yaml
from ros_visualise.sinks.parts import parse_split, part_path
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.files import PageFiles
from ros_visualise.ui.page.settings import PageSettings
from ros_visualise.ui.page.worker import Worker

_START, _STOP = "● Record", "■ Stop recording"
_ALL, _NO = "All", "None"


class RecordingPanel:
    """A name, a split, topics, a button, the recording's state and links, in the present container.

    Anybody on the page may choose the name, so the file stays in one folder, and nothing there is
    replaced. One recording runs at a time; it ends before the disk is full.
    """

    def __init__(
        self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, files: PageFiles
    ) -> None:
        self._runtime, self._files, self._folder = runtime, files, files.folder
        self._recording: RecorderThread | None = None
        self._series: Path | None = None  # the name that those of several files are made of
        self._begun_s = 0.0
        self._name = gui.add_text("File", _new_name(), hint="Such as run.mcap or edges.mp4")
        self._split = gui.add_text(
            "Split", "", hint="Size or duration of a file: 1G or 10m; empty = one file"
        )
        self._topics = _Topics(gui, worker)
        self._topics.follow(runtime.graph)
        self._button = gui.add_button(_START)
        self._note = gui.add_html("", visible=False)
        self._links = gui.add_html("")
        self._show_links()
        self._button.on_click(worker.listener("record", self._press))

    def follow(self, graph: Graph) -> None:
        self._topics.follow(graph)

    def close(self) -> None:
        """Offer the file of a recording that ends with the run."""
        if self._recording is not None:
            self._offer(self._recording)

    def refresh(self) -> None:
        """Show the recording's state; raises the error by which it has ended, if any."""
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
        dropped += f" ({recording.refused} rejected)" if recording.refused else ""
        files = f" in {recording.files} files" if recording.files > 1 else ""
        state = f"{recording.path}: {recording.written} messages{files}{dropped}"
        state += self._room(recording)
        self._note.content = f'<div class="rv-note">{escape(state)}</div>'
        self._note.visible = True

    def _room(self, recording: RecorderThread) -> str:
        """Size of the recording, and the time for which there is disk space."""
        try:
            size = sum(map(_size, self._paths(recording)))
            free = shutil.disk_usage(self._folder).free
        except OSError:  # it is being renamed or removed
            return ""
        per_s = size / max(time.monotonic() - self._begun_s, 1.0)
        left = f", about {_span(free / per_s)} of space left" if per_s else ""
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
        """Its present files, or its folder."""
        if self._series is None:
            return [recording.path]
        return [part_path(self._series, number) for number in range(recording.files)]

    def _show_links(self) -> None:
        links = self._files.links
        text = f'<div class="rv-note rv-links">Download: {links}</div>' if links else ""
        self._links.content = text


class _Topics:
    """A switch for each topic, initially on for those recorded by default."""

    def __init__(self, gui: viser.GuiApi, worker: Worker) -> None:
        self._gui = gui
        self._switches: dict[str, viser.GuiCheckboxHandle] = {}
        self._usual: set[str] = set()
        self._folder = gui.add_folder("Topics to record", expand_by_default=False)
        with self._folder:
            buttons = gui.add_button_group("Select", (_ALL, _NO))
        buttons.on_click(worker.listener(None, self._set_all))

    def follow(self, graph: Graph) -> None:
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
        """The topics to record; empty for the default ones.

        Raises:
            UsageError: no topic is chosen.
        """
        chosen = [name for name, switch in self._switches.items() if switch.value]
        if not chosen:
            raise UsageError("choose at least one topic to record")
        return () if set(chosen) == self._usual else tuple(chosen)

    def _set_all(self, label: str) -> None:
        for switch in self._switches.values():
            set_value(switch, label == _ALL)


def _size(path: Path) -> int:
    """Bytes of a file, or of all in a folder."""
    files = [one for one in path.rglob("*") if one.is_file()] if path.is_dir() else [path]
    return sum(one.stat().st_size for one in files)


def _span(seconds: float) -> str:
    for unit, length in (("days", 86400), ("hours", 3600), ("minutes", 60)):
        if seconds > 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} seconds"


def _new_name() -> str:
    return f"record-{datetime.now():%Y%m%d-%H%M%S}.mcap"


class SavePanel:
    """File names, buttons, and the file saved last, in the present container.

    As with recordings, files stay in one folder, and no file is replaced.
    """

    def __init__(
        self, gui: viser.GuiApi, runtime: Runtime, worker: Worker, folder: Path, kept: PageSettings
    ) -> None:
        self._gui, self._worker, self._folder = gui, worker, folder
        parameters = "YAML file for --params and launch files"
        self._add("parameters", parameters, lambda path: save(live_parameters(runtime), path))
        layout = "YAML file for --layout"
        self._add("layout", layout, lambda path: write_yaml(kept.saved, path))
        self._note = gui.add_html("", visible=False)

    def _add(self, what: str, hint: str, write: Callable[[Path], None]) -> None:
        name = self._gui.add_text(what.capitalize(), new_name(what), hint=hint)
        button = self._gui.add_button(f"Save {what}")
        button.on_click(self._worker.listener(("save", what), partial(self._save, name, write)))

    def _save(self, name: Any, write: Callable[[Path], None], _: bool) -> None:
        path = inside(self._folder, name.value)
        write(path)
        self._note.content = f'<div class="rv-note">{escape(f"Saved {path}")}</div>'
        self._note.visible = True
        set_value(name, new_name(name.label.lower()))
