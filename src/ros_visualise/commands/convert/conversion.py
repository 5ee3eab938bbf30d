"""Copying a recording into a new one."""

from __future__ import annotations

import contextlib
import threading
from collections import Counter, deque
from collections.abc import Collection, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Image
from ros_visualise.messages.latched import says
from ros_visualise.sinks import Recorder
from ros_visualise.sources.recordings import Entry, Recording


@dataclass(frozen=True)
class Part:
    """What of a recording is copied: the topics, from one time to before another; None is all."""

    topics: tuple[str, ...]
    start_ns: int | None = None
    stop_ns: int | None = None


@dataclass
class Conversion:
    """Copies a part of a recording.

    One thread runs it, others may look at it and stop it.

    Attributes:
        written: topic -> messages that were written.
        left_out: topic -> messages that could not be written.
        reasons: topic -> why the first of them could not.
    """

    recording: Recording
    part: Part
    recorder: Recorder
    written: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    _stopped: bool = False
    _closing: bool = False

    @property
    def steps(self) -> int | None:
        """How many messages were worked on by now; None while the new recording is closed."""
        return None if self._closing else self.messages + sum(self.left_out.values())

    @property
    def messages(self) -> int:
        """All that were written by now."""
        return sum(self.written.values())

    def run(self) -> None:
        """Copy, and finish the new recording, also where copying ends early.

        Raises:
            RecordingError: it could not be written to its end.
        """
        with self.recorder, closing(self._entries()) as entries:
            for extra in self.recording.extras():
                self.recorder.add_extra(extra)
            for entry in entries:
                if self._stopped:
                    break
                self._copy(entry)
            self._closing = True
            self.recorder.close(whole=not self._stopped)
            self._closing = False

    def stop(self) -> None:
        """End after the message that is being written, and do not wait for the next."""
        self._stopped = True
        self.recording.close()

    def _copy(self, entry: Entry) -> None:
        try:
            self.recorder.write(entry.topic, entry.message, entry.stamp_ns)
            self.written[entry.topic] += 1
        except DamagedMessage as error:
            self.left_out[entry.topic] += 1
            self.reasons.setdefault(entry.topic, str(error))

    def _entries(self) -> ReadAhead | Generator[Entry, None, None]:
        """Read on a thread of its own where images are decoded.

        What is copied as bytes would only wait for the other thread: Python runs one at a time, and
        memory that another core has touched is slow.
        """
        kinds = [self.recording.topics[topic].type for topic in self.part.topics]
        is_decoded = any(kind.definitions is None for kind in kinds)
        return ReadAhead(self._read()) if is_decoded else self._read()

    def _read(self) -> Generator[Entry, None, None]:
        part = self.part
        if part.start_ns is not None:
            for entry in _latched_before(self.recording, part.topics, part.start_ns):
                yield entry._replace(stamp_ns=part.start_ns)
        yield from self.recording.read(part.start_ns, part.stop_ns, part.topics)


def _latched_before(recording: Recording, topics: Collection[str], start_ns: int) -> list[Entry]:
    """The latched messages that somebody who comes at that time would be given."""
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
            last.update(dict.fromkeys(says(entry.topic, entry.message), entry))
    return sorted({id(entry): entry for entry in last.values()}.values(), key=_stamp)


def _stamp(entry: Entry) -> int:
    return entry.stamp_ns


_AHEAD_BYTES = 32 << 20
_BATCH_BYTES = 256 << 10


class ReadAhead:
    """What a generator gives, a little ahead of who takes it.

    Messages are handed over many at a time: threads that hand over each for itself would spend
    more time on waking each other up than on small messages. Images are decoded here.
    """

    def __init__(self, entries: Generator[Entry, None, None]) -> None:
        self._entries = entries
        self._ready: deque[tuple[int, list[Entry]]] = deque()
        self._ready_bytes = 0
        self._ended = self._stopped = False
        self._error: BaseException | None = None
        self._changed = threading.Condition()
        self._thread = supervision.start("reader", self._read)

    def __iter__(self) -> Iterator[Entry]:
        while (batch := self._take()) is not None:
            yield from batch
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """End reading; what was read and not taken is let go."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        self._thread.join()

    def _take(self) -> list[Entry] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._ready or self._ended)
            if not self._ready:
                return None
            size, batch = self._ready.popleft()
            self._ready_bytes -= size
            self._changed.notify_all()
            return batch

    def _read(self) -> None:
        try:
            with closing(self._entries):
                self._read_all()
        except BaseException as error:
            self._error = error
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _read_all(self) -> None:
        batch: list[Entry] = []
        size = 0
        for entry in self._entries:
            batch.append(entry)
            size += _prepare(entry.message)
            if size >= _BATCH_BYTES:
                if not self._put(size, batch):
                    return
                batch, size = [], 0
        self._put(size, batch)

    def _put(self, size: int, batch: list[Entry]) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: self._ready_bytes < _AHEAD_BYTES or self._stopped)
            self._ready.append((size, batch))
            self._ready_bytes += size
            self._changed.notify_all()
            return not self._stopped


def _prepare(message: Any) -> int:
    """Decode what waits for it; about the bytes that it takes."""
    if isinstance(message, Image):
        with contextlib.suppress(DamagedMessage):  # who takes it meets it again
            _ = message.pixels
    return int(message.nbytes)
