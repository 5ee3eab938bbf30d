"""Parts of a recording that browsers export: new files in one folder, one at a time."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.limits import disk_reserve
from ros_visualise.core.paths import inside
from ros_visualise.core.printing import counted, sized
from ros_visualise.graph import Graph
from ros_visualise.runtime.base import Runtime
from ros_visualise.sinks.conversion import Conversion, begin_conversion, choose_part
from ros_visualise.ui.live.played import open_played, recorded_ns


class PageExporter:
    """Writes parts of what is played, as ``ros-visualise convert`` does.

    Anybody on the page may choose the name, so the file stays in one folder, and nothing there is
    replaced. An export ends before the disk is full.

    Args:
        offer: called with each file or folder that was written.
        say: called with the reason of a failure, and each loss, one line.
    """

    def __init__(
        self,
        runtime: Runtime,
        folder: Path,
        offer: Callable[[Path], None],
        say: Callable[[str], None],
    ) -> None:
        self._runtime, self._folder, self._offer, self._say = runtime, folder, offer, say
        self._conversion: Conversion | None = None
        self._thread: threading.Thread | None = None
        self._shown = ""

    def start(self, name: str, span_s: tuple[float, float | None], topics: Sequence[str]) -> None:
        """Start with what lies between two times, both included; None is the end.

        Args:
            name: of the file; empty: a new one.
            topics: of the recording; empty: all that the file can store.

        Raises:
            UsageError: one runs, or a name, a topic or the range is invalid.
            OpenError: the file exists or cannot be written.
        """
        if self._conversion is not None:
            raise UsageError("an export is running; stop it first")
        path = inside(self._folder, name or f"part-{datetime.now():%Y%m%d-%H%M%S}.mcap")
        recording = open_played(self._runtime)
        if recording is None:
            raise UsageError("only recordings and videos can be exported; use Record instead")
        begin_s, end_s = span_s
        start_ns = recorded_ns(self._runtime, begin_s)
        stop_ns = None if end_s is None else recorded_ns(self._runtime, end_s) + 1
        try:
            part = replace(choose_part(recording, topics), start_ns=start_ns, stop_ns=stop_ns)
            self._conversion = begin_conversion(recording, part, path, named=topics)
        except RosVisualiseError:
            recording.close()
            raise
        self._thread = supervision.start("export", self._run)

    def stop(self) -> None:
        """End early; the part that was written is kept."""
        if self._conversion is not None:
            self._conversion.stop()

    def close(self, timeout_s: float) -> None:
        """End early, as the run does."""
        self.stop()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def refresh(self) -> None:
        """Stop before the disk is full."""
        if self._conversion is None or self._conversion.stopped:
            return
        disk = shutil.disk_usage(self._folder)
        reserve, words = disk_reserve(disk.total)
        if disk.free < reserve:
            self.stop()
            raise UsageError(f"{self._folder.absolute()}: less than {words} left; export stopped")

    @property
    def state(self) -> Mapping[str, Any]:
        """The export as browsers show it."""
        running = self._conversion
        if running is not None:
            self._shown = f"{running.recorder.path}: {counted(running.messages, 'message')}"
        return {"exporting": running is not None, "exported": self._shown}

    def _run(self) -> None:
        conversion = self._conversion
        assert conversion is not None
        try:
            conversion.run()
            path = conversion.recorder.path
            size = sum(one.stat().st_size for one in [path, *path.rglob("*")] if one.is_file())
            self._shown = f"{path}: {counted(conversion.messages, 'message')}, {sized(size)}"
            self._offer(path)
        except (RosVisualiseError, OSError) as error:
            self._say(str(error))
            self._shown = ""
        finally:
            conversion.recording.close()
            for line in conversion.losses:
                self._say(line)
            self._conversion = None


def exportable(graph: Graph) -> list[str]:
    """The topics that can be exported, by their names in the recording."""
    source = graph.source
    if source is None or source.type.recording is None:
        return []
    return list(source.outputs if source.type.makes_time else source.outputs.values())
