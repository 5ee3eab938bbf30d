"""Copying a recording with a progress bar, and the report on it."""

from __future__ import annotations

import threading
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from ros_visualise.commands.convert import ConvertOptions
from ros_visualise.core import supervision
from ros_visualise.core.errors import (
    RecordingError,
    RosVisualiseError,
    UsageError,
    did_you_mean,
)
from ros_visualise.core.printing import counted, print_json, print_status, sized
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.running.interruptible import in_time, interruptible
from ros_visualise.sinks.conversion import (
    Conversion,
    RecordingPart,
    begin_conversion,
    choose_part,
)
from ros_visualise.sinks.names import check_targets, parse_target
from ros_visualise.sources import open_source
from ros_visualise.sources.alignment import read_offsets
from ros_visualise.sources.opening import open_joined
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.joined import JoinedRecording
from ros_visualise.sources.recordings.playing import played_time
from ros_visualise.ui.live.marks import Marks

_SPIN_S = 0.05


def convert(options: ConvertOptions) -> int:
    """Copy a recording into a new file, and report what was lost."""
    target, topics = parse_target(options.output)
    check_targets([target], *options.input)
    recording = interruptible(lambda: _opened(options))
    with closing(recording):
        part = choose_part(recording, options.topics, options.start, options.duration)
        if options.between:
            part = _between(recording, part, options)
        with noticed() as request:
            conversion = begin_conversion(
                recording,
                part,
                target,
                named=topics,
                profile=options.profile,
                compression=options.compression,
                overwrite=options.overwrite,
            )
            with in_time(request, lambda: conversion.steps):
                interrupted, error = _watch(conversion, request)
            return _finish(options, conversion, interrupted, error)


def _opened(options: ConvertOptions) -> Recording:
    if len(options.input) == 1:
        if options.offset:
            raise UsageError(f"--offset {options.offset[0]}: needs several recordings or videos")
        return open_source(options.input[0])
    joined = open_joined([Path(path) for path in options.input])
    joined.move(read_offsets(options.offset, joined))
    return joined


def _between(recording: Recording, part: RecordingPart, options: ConvertOptions) -> RecordingPart:
    """The part between two marks, which are times of the first recording, both included."""
    if options.start is not None or options.duration is not None:
        raise UsageError("--between: give marks, or --start and --duration")
    marks = Marks(Path(options.input[0]))
    at_s = {name: time_s for time_s, name in reversed(marks.names.items())}
    for name in options.between:
        if name not in at_s:
            there = (
                did_you_mean(name, list(at_s)) if at_s else "; set some on the page, with the key M"
            )
            raise UsageError(f"--between: no mark {name!r} in {marks.path}{there}")
    line = played_time(recording, part.topics)
    lead_ns = 0
    if isinstance(recording, JoinedRecording):
        lead_ns = line.place_ns(recording.spans_ns[0][0])
    first, last = sorted(
        line.stamp_ns(lead_ns + round(at_s[name] * 1e9)) for name in options.between
    )
    return replace(part, start_ns=first, stop_ns=last + 1)


def _watch(conversion: Conversion, request: StopRequest) -> tuple[bool, RosVisualiseError | None]:
    """Run it with a progress bar; true if interrupted, and the error that ended it early."""
    errors: list[BaseException] = []

    def work() -> None:
        try:
            conversion.run()
        except BaseException as error:
            errors.append(error)

    writer = supervision.start("writer", work)
    try:
        interrupted = _show(conversion, request, writer)
    finally:
        conversion.stop()
        writer.join()
    error = errors[0] if errors else None
    if error is None or isinstance(error, RosVisualiseError):
        return interrupted, error
    raise error


def _show(conversion: Conversion, request: StopRequest, writer: threading.Thread) -> bool:
    """Show its progress until it is done; true if it was interrupted."""
    interrupted = False
    tqdm.set_lock(threading.RLock())  # its own is for processes too, and slow to import
    with tqdm(
        total=_expected(conversion),
        unit=" messages",
        unit_scale=True,
        disable=None,
        dynamic_ncols=True,
        leave=False,
    ) as bar:
        while writer.is_alive():
            writer.join(_SPIN_S)
            bar.update(conversion.messages - bar.n)
            if request.asked and not interrupted:
                interrupted = True
                conversion.stop()
    return interrupted


def _expected(conversion: Conversion) -> int:
    """Estimated number of messages."""
    recording, part = conversion.recording, conversion.part
    count = sum(recording.topics[topic].messages for topic in part.topics)
    begin_ns = part.start_ns or recording.start_ns
    end_ns = min(part.stop_ns or recording.end_ns, recording.end_ns)
    length_ns = recording.end_ns - recording.start_ns
    return round(count * (end_ns - begin_ns) / length_ns) if length_ns else count


def _finish(
    options: ConvertOptions,
    conversion: Conversion,
    interrupted: bool,
    error: Exception | None,
) -> int:
    notes = conversion.losses
    if error is not None:
        notes.append(str(error))
    target = parse_target(options.output)[0]
    if conversion.recorder.path != target and not isinstance(error, RecordingError):
        notes.append(f"{target} unchanged; partial output in {conversion.recorder.path}")
    for note in notes:
        print_status(f"ros-visualise: {note}")
    if not (conversion.messages or notes or interrupted):
        print_status(f"ros-visualise: {conversion.recording.path}: {_describe_empty(options)}")
    if unplaced := conversion.recorder.unplaced:
        extras = ", ".join(counted(count, noun) for noun, count in unplaced.items())
        print_status(f"ros-visualise: {target} cannot store {extras}")
    report = conversion.report(notes)
    if Path(report["path"]).exists():
        on = counted(len(report["topics"]), "topic")
        what = f"{counted(report['messages'], 'message')} on {on}, {sized(report['bytes'])}"
        print_status(f"{report['path']}: {what}")
    if options.json:
        print_json(report)
    return STOPPED if interrupted else int(bool(notes))


def _describe_empty(options: ConvertOptions) -> str:
    """Message for a part without messages, which is no loss."""
    words = ["no messages"]
    if options.topics:
        words.append(f"on {', '.join(options.topics)}")
    start_s = options.start or 0.0
    if options.duration is not None:
        words.append(f"from {start_s:g} s to {start_s + options.duration:g} s")
    elif start_s:
        words.append(f"from {start_s:g} s onwards")
    return " ".join(words)
