"""Copying a recording with a progress bar, and the report on it."""

from __future__ import annotations

import threading
from contextlib import closing
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ros_visualise.commands.convert import ConvertOptions
from ros_visualise.commands.convert.conversion import Conversion, RecordingPart
from ros_visualise.core import supervision
from ros_visualise.core.errors import (
    DamagedMessage,
    OpenError,
    RecordingError,
    RosVisualiseError,
    UsageError,
)
from ros_visualise.core.printing import counted, print_json, print_status, sized
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.running.interruptible import in_time, interruptible
from ros_visualise.sinks import encoding_of, kind_of, open_recorder
from ros_visualise.sinks.encoding import Encoder
from ros_visualise.sinks.names import check_targets, parse_target
from ros_visualise.sources import open_source
from ros_visualise.sources.recordings import Recording

_SPIN_S = 0.05
_NS = 1_000_000_000


def convert(options: ConvertOptions) -> int:
    """Copy a recording into a new file, and report what was lost."""
    target, topics = parse_target(options.output)
    check_targets([target], options.input)
    encoding = encoding_of(target, options.profile)
    if kind_of(target) == "mp4":
        raise UsageError(
            f"{target}: convert writes no videos; use ros-visualise bag SRC --record {target}"
        )
    recording = interruptible(lambda: open_source(options.input))
    with closing(recording):
        part = _choose_part(recording, options)
        unwritable = _find_unwritable(recording, part, Encoder(encoding))
        types = {t: recording.topics[t].type for t in part.topics if t not in unwritable}
        if unwritable and not types:
            reasons = "; ".join(f"{topic}: {reason}" for topic, reason in unwritable.items())
            raise OpenError(f"{options.input}: no topic can be written: {reasons}")
        with noticed() as request:
            recorder = open_recorder(
                target,
                types,
                options.overwrite,
                named=topics,
                profile=options.profile,
                compression=options.compression,
                live=False,
            )
            part = RecordingPart(tuple(types), part.start_ns, part.stop_ns)
            conversion = Conversion(recording, part, recorder)
            with in_time(request, lambda: conversion.steps):
                interrupted, error = _watch(conversion, request)
            return _finish(options, conversion, unwritable, interrupted, error)


def _choose_part(recording: Recording, options: ConvertOptions) -> RecordingPart:
    for name in options.topics:
        if name not in recording.topics:
            there = ", ".join(recording.topics)
            raise UsageError(f"{recording.path}: no topic {name}; choose from {there}")
    topics = tuple(t for t in recording.topics if not options.topics or t in options.topics)
    if options.start is None and options.duration is None:
        return RecordingPart(topics)
    start_ns = recording.start_ns + round((options.start or 0) * _NS)
    if start_ns > recording.end_ns:
        length_s = (recording.end_ns - recording.start_ns) / _NS
        raise UsageError(f"--start {options.start:g}: {recording.path} ends after {length_s:.3f} s")
    stop_ns = None if options.duration is None else start_ns + round(options.duration * _NS)
    return RecordingPart(topics, start_ns if options.start else None, stop_ns)


def _find_unwritable(recording: Recording, part: RecordingPart, encoder: Encoder) -> dict[str, str]:
    """Topic -> why its messages cannot be written."""
    found = {}
    for topic in part.topics:
        info, definitions = recording.topics[topic], recording.topics[topic].type.definitions
        is_copied = definitions is not None and definitions.encoding == encoder.encoding
        if info.unreadable and not is_copied:
            found[topic] = info.unreadable
            continue
        try:
            encoder.declare(info.type)
        except DamagedMessage as error:
            found[topic] = str(error)
    return found


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
    unwritable: dict[str, str],
    interrupted: bool,
    error: Exception | None,
) -> int:
    notes = _notes(options.input, conversion, unwritable)
    if error is not None:
        notes.append(str(error))
    target = parse_target(options.output)[0]
    if conversion.recorder.path != target and not isinstance(error, RecordingError):
        notes.append(f"{target} unchanged; partial output in {conversion.recorder.path}")
    for note in notes:
        print_status(f"ros-visualise: {note}")
    if not (conversion.messages or notes or interrupted):
        print_status(f"ros-visualise: {options.input}: {_describe_empty(options)}")
    if unplaced := conversion.recorder.unplaced:
        extras = ", ".join(counted(count, noun) for noun, count in unplaced.items())
        print_status(f"ros-visualise: {target} cannot store {extras}")
    report = _report(conversion, unwritable, notes)
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
        words.append(f"from {start_s:g} s on")
    return " ".join(words)


def _notes(source: str, conversion: Conversion, unwritable: dict[str, str]) -> list[str]:
    """Losses, for people."""
    notes = [f"{source}: {note}" for note in conversion.recording.loss.notes]
    notes += [f"{topic}: skipped: {reason}" for topic, reason in unwritable.items()]
    notes += [
        f"{topic}: {counted(count, 'message')} skipped: {conversion.reasons[topic]}"
        for topic, count in conversion.skipped.items()
    ]
    return notes


def _report(conversion: Conversion, unwritable: dict[str, str], notes: list[str]) -> dict[str, Any]:
    recording, path = conversion.recording, conversion.recorder.path
    files = list(path.iterdir()) if path.is_dir() else [path]
    skipped = sum(recording.topics[topic].messages for topic in unwritable)
    skipped += sum(conversion.skipped.values())
    return {
        "path": str(path),
        "format": "folder" if path.is_dir() else kind_of(path),
        "messages": conversion.messages,
        "bytes": sum(file.stat().st_size for file in files if file.exists()),
        "topics": {
            topic: {
                "type": recording.topics[topic].type.name,
                "messages": conversion.written[topic],
            }
            for topic in conversion.part.topics
        },
        "unplaced": dict(conversion.recorder.unplaced),
        "lost": {
            "messages": recording.loss.messages + skipped,
            "bytes": recording.loss.bytes,
            "notes": notes,
        },
    }
