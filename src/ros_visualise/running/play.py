"""Playing a source through the nodes, with a view of it: `video`, `camera`, `bag` and others."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.core.paths import set_folder
from ros_visualise.core.printing import counted, print_json, print_status, without_secrets
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.graph import Graph
from ros_visualise.links.commands import permit
from ros_visualise.running.graphs import Selection, following, graph_of, stepped_topic
from ros_visualise.running.interruptible import in_time, interruptible, opened_within
from ros_visualise.running.network import Running, join, running
from ros_visualise.running.options import OutputOptions, PlayingOptions, ViewingOptions
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Transport
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.report import RecordingReport, RunReport, to_json
from ros_visualise.sinks.names import check_targets, parse_target
from ros_visualise.sinks.parts import Split, existing_parts, parse_split, part_path
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import View, ViewOptions, open_view, read_arrangement
from ros_visualise.ui.file_chooser import FileChooser, Wanted

log = logging.getLogger(__name__)

_SPIN_S = 0.05
_OPEN_S = 60.0  # for a file that is opened from the page
_PATIENCE_S = 4.0  # for the first browser
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def play(selection: Selection, options: PlayingOptions) -> int:
    """Play a source until it ends or a person stops it; 1 if data was lost."""
    split = _split(options)
    targets = [one for target in options.record for one in _files(parse_target(target)[0], split)]
    check_targets(targets, selection.path, *selection.more)
    set_folder(options.record_dir, options.overwrite)
    permit(options.allow_control)
    logging.getLogger("ros_visualise").setLevel(logging.INFO)
    chooser = _chooser(selection, options.record_dir)
    viewed = view_options(options, options.record_dir, selection.name, chooser)
    transport = interruptible(lambda: join(options, "pipeline"))
    with closing(transport) if transport else nullcontext():
        graph = interruptible(lambda: graph_of(selection, options))
        with closing(open_view(options.view, viewed)) as view:
            opening = partial(_open, view=view, transport=transport)
            process = interruptible(lambda: opening(options, graph))
            return _run(_Played(selection, options, process, opening), view, chooser)


def view_options(
    options: ViewingOptions, record_dir: Path, name: str, chooser: FileChooser | None = None
) -> ViewOptions:
    """View options from the options of a command.

    Args:
        options: viewing options of the command.
        record_dir: the only folder in which the page records.
        name: of what is shown.
        chooser: the files that can be opened from the page.
    """
    return ViewOptions(
        options.host,
        options.port,
        options.allow_origin,
        record_dir,
        title=f"{name} - ros_visualise",
        browser=has_desktop(os.environ) if options.open is None else options.open,
        arrangement=read_arrangement(options.layout) if options.layout else {},
        chooser=chooser,
        token=options.token,
        urdf=options.urdf,
        tiles=options.tiles,
        control=options.allow_control,
    )


def _split(options: OutputOptions) -> Split | None:
    if options.split is not None and not options.record:
        raise UsageError(f"--split {options.split}: needs --record OUT")
    return None if options.split is None else parse_split(options.split)


def _files(path: Path, split: Split | None) -> list[Path]:
    """The files of a recording: of a series the first one, and existing ones."""
    if split is None or not path.suffix:
        return [path]
    return list({0: part_path(path, 0), **existing_parts(path)}.values())


def _chooser(selection: Selection, folder: Path) -> FileChooser:
    """Files to open instead: those beside the file, or else in the current folder."""
    given = Path(selection.path)
    is_file = os.path.exists(given) and given.name != ""
    chooser = FileChooser(given.parent if is_file else Path(), folder, given if is_file else None)
    chooser.more = [Path(path) for path in selection.more]
    return chooser


def _run(played: _Played, view: View, chooser: FileChooser) -> int:
    with noticed() as request:
        with in_time(request, lambda: played.runtime.steps):
            stopped = _play(played, view, request, chooser)
        report = played.report()
        if played.options.json:
            print_json(to_json(report), default=str)
    return STOPPED if stopped else int(played.lost)


def _open(
    options: PlayingOptions, graph: Graph, view: View, transport: Transport | None
) -> Running:
    playback = _playback(options, graph, view.stays)
    if options.paused:
        playback.pause()
    playback.step_topic = stepped_topic(graph)
    return running(graph, playback, transport)


def _playback(options: PlayingOptions, graph: Graph, stays: bool) -> Playback:
    """The playback that the options ask for; ``stays``: its view stays open at the end.

    In such a view ``--start`` and ``--duration`` are the playback range of a film or a recording.
    """
    source = graph.source.type if graph.source is not None else None
    has_range = stays and source is not None and not (source.live or source.inputs)
    start_s, duration_s = options.start or 0.0, options.duration
    end_s = None if duration_s is None else start_s + duration_s
    return Playback(
        rate=1.0 if options.rate is None else options.rate,
        loop=options.loop or (stays and source is not None and source.seamless),
        start_s=start_s,
        duration_s=None if has_range else duration_s,
        frames=options.frames,
        hold=stays and (has_range or duration_s is None) and options.frames is None,
        part_s=(start_s, end_s) if has_range else (0.0, None),
    )


class _Played:
    """The run that is played, with the reports of those before it.

    Attributes:
        lost: data was lost.
    """

    def __init__(
        self,
        selection: Selection,
        options: PlayingOptions,
        process: Running,
        opening: Callable[[PlayingOptions, Graph], Running],
    ) -> None:
        self.selection, self.options, self.process = selection, options, process
        self.lost = False
        self._opening = opening
        self.recordings: list[RecorderThread] = []
        self._recorded: dict[str, RecordingReport] = {}

    @property
    def runtime(self) -> LocalRuntime:
        """The runtime of what is played."""
        return self.process.runtime

    @property
    def is_over(self) -> bool:
        """True if it has ended, or all its recordings have failed."""
        failed = [one.error is not None for one in self.recordings]
        return self.runtime.wait(0) or bool(failed and all(failed))

    def report(self) -> RunReport:
        """The report of a run that was stopped; prints its summary."""
        report = self.runtime.report()
        _print_summary(report)
        self.lost |= self.process.failed
        self._recorded |= report.recordings
        return replace(report, recordings=dict(self._recorded))

    def follow(self, wanted: Wanted, request: StopRequest) -> bool:
        """Open what a person wants; True if that worked, else it is logged."""
        opening = partial(self._open_next, wanted)
        try:
            opened = opened_within(
                without_secrets(str(wanted.what)),
                _OPEN_S,
                request,
                opening,
                lambda late: late[-1].stop(),
            )
        except RosVisualiseError as error:
            log.error("%s", error)
            return False
        if opened is None:
            return False
        self.process.stop()
        self.report()
        self.process.leave()
        self.selection, self.options, self.process = opened
        self.recordings = []
        return True

    def _open_next(self, wanted: Wanted) -> tuple[Selection, PlayingOptions, Running]:
        selection, options, graph = following(
            self.selection, self.options, wanted.what, self.runtime, wanted.adds
        )
        process = self._opening(options, graph)
        before, now = self.runtime.playback, process.runtime.playback
        if wanted.adds and before is not None and now is not None:
            now.seek(before.state.position_s - before.lead_s + now.lead_s)
        return selection, options, process


def _play(played: _Played, view: View, request: StopRequest, chooser: FileChooser) -> bool:
    """Play to the end, and close all recordings; True if it was stopped before."""
    try:
        options, runtime = played.options, played.runtime
        split = _split(options)
        played.recordings = _start_recordings(runtime, options.record, options.overwrite, split)
        view.open(runtime)  # before latched messages can have passed
        if not runtime.graph.live:
            _await_browser(view, request)
        played.process.start()
        while not (played.is_over or view.closed):
            if request.asked:
                return True
            wanted = chooser.take()
            if wanted is not None and played.follow(wanted, request):
                chooser.opened(wanted)
                view.open(played.runtime)
                played.process.start()
            view.spin(_SPIN_S)
            played.process.follow()
        return False
    finally:
        view.close()
        played.process.stop()


def _await_browser(view: View, request: StopRequest) -> None:
    """Wait for the first browser, for a few seconds, so that it shows the beginning."""
    end_s = time.monotonic() + _PATIENCE_S
    while view.awaited and not request.asked and time.monotonic() < end_s:
        view.spin(_SPIN_S)


def has_desktop(environment: Mapping[str, str]) -> bool:
    """True if a person at a terminal sees the screen of this machine."""
    has_screen = sys.platform in ("darwin", "win32") or any(map(environment.get, _SCREENS))
    return bool(has_screen and sys.stderr.isatty() and not environment.get("SSH_CONNECTION"))


def _start_recordings(
    runtime: LocalRuntime, targets: Sequence[str], overwrite: bool, split: Split | None
) -> list[RecorderThread]:
    """Start all recordings, or none."""
    recordings: list[RecorderThread] = []
    try:
        for target in targets:
            path, topics = parse_target(target)
            recordings.append(runtime.start_recording(path, overwrite, topics, split))
    except RosVisualiseError:
        for recording in recordings:
            recording.discard()
            runtime.stop_recording(recording)
        raise
    return recordings


def _print_summary(report: RunReport) -> None:
    for name, topic in report.topics.items():
        rates = f"{topic.hz or 0:g} Hz by timestamps, {topic.wall_hz or 0:g} Hz in real time"
        print_status(f"{name}: {counted(topic.messages, 'message')}, {rates}")
    for name, node in report.nodes.items():
        of = f" of {node.received}" if node.received > node.processed else ""  # not of a source
        for reason, count in node.dropped.items():
            print_status(
                f"{name}: {count}{of} dropped ({'queue full' if reason == 'queue' else reason})"
            )
    for name, recording in report.recordings.items():
        dropped = f", {recording.dropped} dropped" if recording.dropped else ""
        dropped += f" ({recording.refused} rejected)" if recording.refused else ""
        messages = counted(recording.messages, "message")
        files = f" in {recording.files} files" if recording.files > 1 else ""
        print_status(f"{name}: {messages} recorded{files}{dropped}")
