"""One task: a recording, or a part of one, through the pipeline into a folder of tables."""

from __future__ import annotations

import logging
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ros_visualise.batch.rows import Part, RowRecorder, parse_field
from ros_visualise.batch.tables import connect
from ros_visualise.batch.work import Work
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.core.limits import max_memory
from ros_visualise.core.supervision import PROCESS
from ros_visualise.graph import Graph
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import NodeReport, RunReport
from ros_visualise.sinks.names import parse_target
from ros_visualise.sources.opening import open_source
from ros_visualise.sources.playback import Playback

_SPIN_S = 1.0
_NS = 1_000_000_000
_TAIL_S = 1.0  # of a part, so that what waits for later messages is complete
_ROWS_SHARE = 8  # of the memory, for writing rows
PICTURES = "pictures"


@dataclass(frozen=True)
class Task:
    """A task, which can be sent to another process.

    Attributes:
        key: digest of everything that its results depend on.
        path: the recording.
        work: what is done with it.
        folder: of the tasks' results; the results are its folder ``key``.
        begin_s, until_s: the part of the recording, in seconds from its start; None: all of it.
        warm_up_s: seconds that are played before the part.
    """

    key: str
    path: str
    work: Work
    folder: str
    begin_s: float | None = None
    until_s: float | None = None
    warm_up_s: float = 0.0


class About(NamedTuple):
    """A recording before it is run: its format, its times, and nodes that need all of it."""

    format: str
    start_ns: int
    end_ns: int
    unsplittable: tuple[str, ...] = ()


def survey(task: Task) -> About:
    """Open a recording; raises RosVisualiseError if it cannot be run."""
    with closing(open_source(Path(task.path))) as opened:
        about = About(opened.format, opened.start_ns, opened.end_ns)
    graph = task.work.graph(task.path)
    LocalRuntime(graph, Playback(rate=0.0)).stop()  # which closes the source
    return about._replace(
        unsplittable=tuple(node.name for node in graph.nodes if not node.type.splittable)
    )


def run_task(task: Task) -> None:
    """Run a task; its folder exists when it is done, whole.

    Raises:
        RosVisualiseError: the recording cannot be opened or its rows cannot be written.
    """
    done = Path(task.folder) / task.key
    made = done.with_name(f"{task.key}.{socket.gethostname()}.{os.getpid()}.part")
    made.mkdir()
    try:
        _fill(task, made)
        with suppress(OSError):  # another process may have been faster
            made.rename(done)
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _fill(task: Task, folder: Path) -> None:
    began_s, cpu_s = time.monotonic(), time.process_time()
    work = task.work
    with _collected_log() as lines, closing(connect(max_memory() // _ROWS_SHARE, folder)) as sql:
        with closing(open_source(Path(task.path))) as opened:
            about = About(opened.format, opened.start_ns, opened.end_ns)
        graph = work.graph(task.path)
        fields = [parse_field(text) for text in work.fields]
        part = _part(task, _zero_ns(graph, about))
        rows = RowRecorder(graph, part, fields, sql, folder, PICTURES in work.export)
        report = _play(graph, _playback(task), rows, work, folder)
        errors, reason = _errors(report, lines)
        assert graph.source is not None
        for name, one in report.nodes.items():
            rows.add_row("nodes", _node_row(name, one))
        row = (
            *(about.format, about.start_ns, about.end_ns, task.begin_s, task.until_s),
            *(rows.messages(graph.source.name), errors, reason),
            "; ".join(note for one in report.nodes.values() for note in one.unread),
            *(time.process_time() - cpu_s, time.monotonic() - began_s, _peak_mb()),
            *(socket.gethostname(), work.version),
        )
        rows.add_row("segments", row)
        rows.finish()


def _zero_ns(graph: Graph, about: About) -> int:
    """The log time at the start of the recording; that of a film is zero."""
    assert graph.source is not None
    return about.start_ns if graph.source.name == "player" else 0


def _part(task: Task, zero_ns: int) -> Part:
    if task.begin_s is None or task.until_s is None:
        return Part()
    # the first one also has what comes before the start, the last one what comes after the end
    begin_ns = zero_ns + round(task.begin_s * _NS) if task.begin_s else Part().begin_ns
    return Part(begin_ns, zero_ns + task.until_s * _NS)


def _playback(task: Task) -> Playback:
    if task.begin_s is None or task.until_s is None:
        return Playback(rate=0.0)
    start_s = max(0.0, task.begin_s - task.warm_up_s)
    return Playback(rate=0.0, start_s=start_s, duration_s=task.until_s + _TAIL_S - start_s)


def _play(
    graph: Graph, playback: Playback, rows: RowRecorder, work: Work, folder: Path
) -> RunReport:
    """Play to the end, with the rows and the files of the task; its report."""
    runtime = LocalRuntime(graph, playback)
    writer = RecorderThread(rows, graph, lossless=True)
    try:
        for topic, listener in writer.listeners.items():
            runtime.topic(topic).connect(listener)
        for text in work.record:
            path, topics = parse_target(text)
            runtime.start_recording(folder / path.name, False, topics)
        runtime.start()
        while not runtime.wait(_SPIN_S):
            if writer.error:
                break
    finally:
        runtime.stop()
        writer.close()
    if writer.error:
        raise writer.error
    if any(one.dropped for one in runtime.report().recordings.values()):
        raise RosVisualiseError("a recording is incomplete")
    if runtime.failed and not PROCESS.failures and not _node_errors(runtime.report()):
        raise RosVisualiseError("the source failed")
    return runtime.report()


def _node_row(name: str, one: NodeReport) -> tuple[Any, ...]:
    dropped = sum(one.dropped.values())
    inputs = ",".join(one.inputs.values())
    return name, inputs, one.processed, dropped, one.errors, one.step_ms, one.p50_ms, one.p99_ms


def _node_errors(report: RunReport) -> int:
    return sum(one.errors + one.dropped.get("error", 0) for one in report.nodes.values())


def _errors(report: RunReport, lines: list[str]) -> tuple[int, str]:
    """Number of errors of nodes, and the first one."""
    count = _node_errors(report) + sum(PROCESS.failures.values())
    return count, (lines[0] if lines else "") if count else ""


def _peak_mb() -> float:
    import resource  # not on Windows
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


@contextmanager
def _collected_log() -> Iterator[list[str]]:
    """The lines of errors that are logged within this block."""
    lines: list[str] = []

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            lines.append(record.getMessage())

    log, handler = logging.getLogger("ros_visualise"), Collector(logging.ERROR)
    log.addHandler(handler)
    try:
        yield lines
    finally:
        log.removeHandler(handler)
