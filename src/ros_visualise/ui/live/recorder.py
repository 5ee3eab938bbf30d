"""Recording by a browser: new files in one folder, one recording at a time."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Collection, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.paths import inside
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.runtime.ordering import recordable
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.sinks.parts import parse_split, part_path


class PageRecorder:
    """Records a graph; a recording ends before the disk is full.

    Anybody on the page may choose the name, so the file stays in one folder, and nothing there is
    replaced.

    Args:
        offer: called with each file or folder that was recorded.
    """

    def __init__(self, runtime: Runtime, folder: Path, offer: Callable[[Path], None]) -> None:
        self._runtime, self._folder, self._offer = runtime, folder, offer
        self._recording: RecorderThread | None = None
        self._series: Path | None = None  # the name that those of several files are made of
        self._begun_s = 0.0
        self._shown = ""

    def start(self, name: str, split: str, topics: Collection[str] | None) -> None:
        """Start recording topics; without a name, to a new one; without topics, the usual ones.

        Raises:
            UsageError: no topic is chosen, or a name or a split is invalid.
            OpenError: it exists or cannot be written.
        """
        if self._recording is not None:
            raise UsageError("a recording is running; stop it first")
        if topics is not None and not topics:
            raise UsageError("choose at least one topic to record")
        path = inside(self._folder, name or f"record-{datetime.now():%Y%m%d-%H%M%S}.mcap")
        parts = parse_split(split) if split else None
        usual = topics is None or set(topics) == usual_topics(self._runtime.graph)
        chosen = () if usual else tuple(topics or ())
        self._recording = self._runtime.start_recording(path, topics=chosen, split=parts)
        self._series = path if parts and path.suffix else None
        self._begun_s = time.monotonic()

    def stop(self) -> None:
        """End the recording, if one runs, and offer its files."""
        recording, self._recording = self._recording, None
        if recording is not None:
            self._runtime.stop_recording(recording)
            self._shown = self._describe(recording)
            for path in self._paths(recording):
                self._offer(path)

    def close(self) -> None:
        """Offer the files of a recording that ends with the run."""
        if self._recording is not None:
            for path in self._paths(self._recording):
                self._offer(path)

    def refresh(self) -> None:
        """Raise the error by which a recording has ended, if any."""
        recording = self._recording
        if recording is not None and recording.error is not None:
            self.stop()
            raise recording.error

    @property
    def state(self) -> Mapping[str, Any]:
        """The recording as browsers show it."""
        if self._recording is not None:
            self._shown = self._describe(self._recording)
        return {"recording": self._recording is not None, "text": self._shown}

    def _describe(self, recording: RecorderThread) -> str:
        dropped = f", {recording.dropped} dropped" if recording.dropped else ""
        dropped += f" ({recording.refused} rejected)" if recording.refused else ""
        files = f" in {recording.files} files" if recording.files > 1 else ""
        state = f"{recording.path}: {recording.written} messages{files}{dropped}"
        return state + self._room(recording)

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

    def _paths(self, recording: RecorderThread) -> list[Path]:
        """Its present files, or its folder."""
        if self._series is None:
            return [recording.path]
        return [part_path(self._series, number) for number in range(recording.files)]


def usual_topics(graph: Graph) -> set[str]:
    """The topics that are recorded by default."""
    rare = {name for name, topic in graph.topics.items() if topic.on_demand}
    return recordable(graph).keys() - rare


def _size(path: Path) -> int:
    """Bytes of a file, or of all in a folder."""
    files = [one for one in path.rglob("*") if one.is_file()] if path.is_dir() else [path]
    return sum(one.stat().st_size for one in files)


def _span(seconds: float) -> str:
    for unit, length in (("days", 86400), ("hours", 3600), ("minutes", 60)):
        if seconds > 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} seconds"
