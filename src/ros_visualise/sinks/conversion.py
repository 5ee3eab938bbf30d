"""Copying a recording into a new one."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ros_visualise.core.errors import DamagedMessage, OpenError, UsageError, did_you_mean
from ros_visualise.core.printing import counted
from ros_visualise.data import Image
from ros_visualise.messages.latched import replaced
from ros_visualise.sinks import Profile, Recorder, encoding_of, kind_of, open_recorder
from ros_visualise.sinks.encoding import Encoder
from ros_visualise.sources.recordings import Entry, Recording

_NS = 1_000_000_000
_BATCH_BYTES = 1 << 20
_MOST_AHEAD = 16


@dataclass(frozen=True)
class RecordingPart:
    """A part of a recording: its topics, from one time to before another; None is all."""

    topics: tuple[str, ...]
    start_ns: int | None = None
    stop_ns: int | None = None


@dataclass
class Conversion:
    """Copies a part of a recording.

    One thread runs it, others may look at it and stop it.

    Attributes:
        unwritable: topic -> why none of its messages can be written.
        written: topic -> messages that were written.
        skipped: topic -> messages that could not be written.
        reasons: topic -> why the first of them could not.
        stopped: it ends early.
    """

    recording: Recording
    part: RecordingPart
    recorder: Recorder
    unwritable: Mapping[str, str]
    written: Counter[str] = field(default_factory=Counter)
    skipped: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    stopped: bool = False
    _closing: bool = False

    @property
    def steps(self) -> int | None:
        """Number of messages processed by now; None while the new recording is being closed."""
        return None if self._closing else self.messages + sum(self.skipped.values())

    @property
    def messages(self) -> int:
        """Number of messages written by now."""
        return sum(self.written.values())

    @property
    def losses(self) -> list[str]:
        """Losses, for people, a line each."""
        lines = [f"{self.recording.path}: {note}" for note in self.recording.loss.notes]
        lines += [f"{topic}: skipped: {reason}" for topic, reason in self.unwritable.items()]
        return lines + [
            f"{topic}: {counted(count, 'message')} skipped: {self.reasons[topic]}"
            for topic, count in self.skipped.items()
        ]

    def report(self, losses: Sequence[str]) -> dict[str, Any]:
        """Everything that was written and lost, as ``convert --json`` prints it."""
        recording, path = self.recording, self.recorder.path
        files = list(path.iterdir()) if path.is_dir() else [path]
        skipped = sum(recording.topics[topic].messages for topic in self.unwritable)
        skipped += sum(self.skipped.values())
        return {
            "path": str(path),
            "format": "folder" if path.is_dir() else kind_of(path),
            "messages": self.messages,
            "bytes": sum(file.stat().st_size for file in files if file.exists()),
            "topics": {
                topic: {"type": recording.topics[topic].type.name, "messages": self.written[topic]}
                for topic in self.part.topics
            },
            "unplaced": dict(self.recorder.unplaced),
            "lost": {
                "messages": recording.loss.messages + skipped,
                "bytes": recording.loss.bytes,
                "notes": list(losses),
            },
        }

    def run(self) -> None:
        """Copy, and finish the new recording, even if copying ends early.

        Raises:
            RecordingError: it could not be written to its end.
        """
        with self.recorder, closing(self._entries()) as entries:
            for extra in self.recording.extras():
                self.recorder.add_extra(extra)
            for entry in entries:
                if self.stopped:
                    break
                self._copy(entry)
            self._closing = True
            self.recorder.close(whole=not self.stopped)
            self._closing = False

    def stop(self) -> None:
        """End after the message that is being written, and do not wait for the next."""
        self.stopped = True
        self.recording.close()

    def _copy(self, entry: Entry) -> None:
        try:
            self.recorder.write(entry.topic, entry.message, entry.stamp_ns)
            self.written[entry.topic] += 1
        except DamagedMessage as error:
            self.skipped[entry.topic] += 1
            self.reasons.setdefault(entry.topic, str(error))

    def _entries(self) -> Generator[Entry, None, None]:
        """The entries of the part, read ahead if images are decoded.

        Bytes that are copied would only wait for the other thread: Python runs one at a time, and
        memory that another core has touched is slow.
        """
        kinds = [self.recording.topics[topic].type for topic in self.part.topics]
        is_decoded = any(kind.definitions is None for kind in kinds)
        return _read_ahead(self._read()) if is_decoded else self._read()

    def _read(self) -> Generator[Entry, None, None]:
        part = self.part
        if part.start_ns is not None:
            for entry in _latched_before(self.recording, part.topics, part.start_ns):
                yield entry._replace(stamp_ns=part.start_ns)
        yield from self.recording.read(part.start_ns, part.stop_ns, part.topics)


def choose_part(
    recording: Recording,
    topics: Collection[str] = (),
    start_s: float | None = None,
    duration_s: float | None = None,
) -> RecordingPart:
    """The part of a recording with these topics, by default all, and in this range of time.

    Raises:
        UsageError: no such topic, or the recording ends before the start.
    """
    for name in topics:
        if name not in recording.topics:
            hint = did_you_mean(name, recording.topics)
            raise UsageError(f"{recording.path}: no topic {name}{hint}")
    chosen = tuple(topic for topic in recording.topics if not topics or topic in topics)
    if start_s is None and duration_s is None:
        return RecordingPart(chosen)
    start_ns = recording.start_ns + round((start_s or 0) * _NS)
    if start_ns > recording.end_ns:
        length_s = (recording.end_ns - recording.start_ns) / _NS
        raise UsageError(
            f"cannot start at {start_s:g} s: {recording.path} ends after {length_s:.3f} s"
        )
    stop_ns = None if duration_s is None else start_ns + round(duration_s * _NS)
    return RecordingPart(chosen, start_ns if start_s else None, stop_ns)


def begin_conversion(
    recording: Recording,
    part: RecordingPart,
    target: Path,
    *,
    named: Collection[str] = (),
    profile: Profile | None = None,
    compression: str | None = None,
    overwrite: bool = False,
) -> Conversion:
    """Open the new recording, with the topics that it can store; see `sinks.open_recorder`.

    Raises:
        OpenError: it exists or cannot be written, or no topic can.
        UsageError: unknown topic, compression or kind of file.
    """
    unwritable = _find_unwritable(recording, part, Encoder(encoding_of(target, profile)))
    types = {t: recording.topics[t].type for t in part.topics if t not in unwritable}
    if unwritable and not types:
        reasons = "; ".join(f"{topic}: {reason}" for topic, reason in unwritable.items())
        raise OpenError(f"{recording.path}: no topic can be written: {reasons}")
    if kind_of(target) == "mp4":
        images = [topic for topic in named or types if types[topic].data_class is Image]
        if len(images) > 1:
            raise UsageError(f"{target}: choose one image topic from {', '.join(images)}")
    recorder = open_recorder(
        target,
        types,
        overwrite,
        named=named,
        profile=profile,
        compression=compression,
        live=False,
    )
    written = tuple(topic for topic in types if topic in recorder.topics)
    return Conversion(recording, replace(part, topics=written), recorder, unwritable)


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


def _latched_before(recording: Recording, topics: Collection[str], start_ns: int) -> list[Entry]:
    """The latched messages that a subscriber at that time would get."""
    latched = [
        topic
        for topic in topics
        if recording.topics[topic].type.qos.transient_local or topic.endswith("/tf_static")
    ]
    if not latched:
        return []
    last: dict[tuple[str, ...], Entry] = {}
    with closing(recording.read(None, start_ns, latched)) as entries:
        for entry in entries:
            last.update(dict.fromkeys(replaced(entry.topic, entry.message), entry))
    kept = {id(entry): entry for entry in last.values()}.values()
    return sorted(kept, key=lambda entry: entry.stamp_ns)


def _read_ahead(entries: Generator[Entry, None, None]) -> Generator[Entry, None, None]:
    """The entries, with their images decoded, read some batches ahead on a thread of its own."""
    pool = ThreadPoolExecutor(1, "reader")
    ahead = deque(pool.submit(_read_batch, entries) for _ in range(_MOST_AHEAD))
    with closing(entries):
        try:
            while ahead:
                batch, error = ahead.popleft().result()
                if batch and error is None:
                    ahead.append(pool.submit(_read_batch, entries))
                yield from batch
                if error is not None:
                    raise error
        finally:
            pool.shutdown(cancel_futures=True)


def _read_batch(entries: Iterator[Entry]) -> tuple[list[Entry], Exception | None]:
    """The next entries, and what ended them early; none at the end."""
    batch: list[Entry] = []
    size = 0
    try:
        for entry in entries:
            batch.append(entry)
            if isinstance(entry.message, Image):
                with suppress(DamagedMessage):  # raised again where it is written
                    _ = entry.message.pixels
            size += int(entry.message.nbytes)
            if size >= _BATCH_BYTES:
                break
    except Exception as error:
        return batch, error
    return batch, None
