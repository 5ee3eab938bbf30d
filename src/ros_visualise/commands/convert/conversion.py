"""Copying a recording into a new one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Generator
from contextlib import closing
from dataclasses import dataclass, field

from ros_visualise.commands.convert.read_ahead import ReadAhead
from ros_visualise.core.errors import DamagedMessage
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
