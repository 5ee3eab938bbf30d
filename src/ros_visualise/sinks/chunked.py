"""Recordings of any number of topics in files made of chunks."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from ros_visualise.core.errors import DamagedMessage, RecordingError
from ros_visualise.messages.recorded import Recorded, TopicType, recorded_ns
from ros_visualise.sinks import Recorder, SinkSettings
from ros_visualise.sinks.encoding import Buffer, Encoder, TopicDeclaration
from ros_visualise.sinks.files import TargetFile

OWN_NAME = "/ros_visualise"
"""The publisher of a topic in recordings of ROS 1, which need one name."""

_LIVE_CHUNK_BYTES = 64 * 1024
_SPAN_NS = 1_000_000_000
END_NS = 2**32 * 1_000_000_000  # of the times that ROS 1 holds
_RECORD_BYTES = 64  # overhead of a message, at most: its record and indexes
_CHECK_BYTES = 64 * 1024


class ChunkedRecorder(Recorder):
    """Messages collected in chunks, each compressed and written as a whole.

    The content of a chunk depends on the sizes and the stamps of messages alone, so that a file
    does not depend on how fast it was written.

    While a graph runs (``live``), messages of the chunk that is not full yet are already at the end
    of the file, uncompressed; later the chunk replaces them. A killed process loses no message that
    it had written, or the last chunk if that was being written. Live chunks are small and span a
    second at most; large messages fill them at once, so that they are written only once.

    Args:
        path: the file.
        topics: topic -> type of its messages; `add` adds others.
        settings: compression and others.

    Raises:
        DamagedMessage: a type that cannot be written.
        OpenError: as `TargetFile`.
    """

    full_bytes: ClassVar[int]
    """Size of a full chunk, unless it is live."""
    head_bytes: ClassVar[int]
    """Overhead of a message in a chunk, approximately."""

    def __init__(self, path: Path, topics: Mapping[str, TopicType], settings: SinkSettings) -> None:
        self._unplaced: Counter[str] = Counter()
        self._encoder, self._live = Encoder(settings.encoding), settings.live
        self.declared = {name: self._encoder.declare(topic) for name, topic in topics.items()}
        self.counts = dict.fromkeys(topics, 0)
        self.start_ns, self.end_ns = END_NS, 0
        self._chunk_bytes = _LIVE_CHUNK_BYTES if settings.live else self.full_bytes
        self._closed = False
        self._kept = self._chunked = 0
        self._waiting: list[int] = []  # stamps of the messages in the chunk
        self._waiting_bytes = 0
        self._unchecked_bytes = _CHECK_BYTES
        self._file = TargetFile(path, settings.overwrite, settings.live)
        try:
            self._begin(self.declared)
            self._end = self._file.tell()
            self._file.keep()
        except OSError as error:
            raise self._fail(error) from None

    @property
    def topics(self) -> tuple[str, ...]:
        return tuple(self.declared)

    @property
    def path(self) -> Path:
        return self._file.path

    @property
    def unplaced(self) -> Counter[str]:
        return self._unplaced

    @property
    def size(self) -> int:
        """Approximate size of the file so far; depends on the messages alone."""
        return self._end + self._waiting_bytes

    def add(self, topic: str, kind: TopicType) -> None:
        """Take another topic from now on; as `ros_visualise.sinks.Recorder`."""
        self._require_open()
        self.declared[topic] = declared = self._encoder.declare(kind)
        self.counts[topic] = 0
        self._write_between(lambda: self._declare(topic, declared))

    def write(self, topic: str, message: Any, stamp_ns: int | None = None) -> None:
        """Record a message; as `ros_visualise.sinks.Recorder`."""
        declared = self.declared.get(topic)
        if declared is None:
            return
        self._require_open()
        if isinstance(message, Recorded) and message.type_name != declared.topic.name:
            expected = declared.topic.name
            raise DamagedMessage(f"{topic}: {message.type_name} instead of {expected}")
        data = self._encoder.encode(message)
        if stamp_ns is None:
            stamp_ns = recorded_ns(message)
        if not 0 <= stamp_ns < END_NS:
            raise DamagedMessage(f"ROS cannot store a stamp of {stamp_ns} ns")
        size = len(data) + _RECORD_BYTES
        self._unchecked_bytes += size
        if self._unchecked_bytes >= _CHECK_BYTES:
            self._require_room(size)
        try:
            if self._live and self._waiting and abs(stamp_ns - self._waiting[0]) >= _SPAN_NS:
                self._end_chunk()
            self._append(topic, stamp_ns, data, message)
            self._waiting.append(stamp_ns)
            self._waiting_bytes += len(data) + self.head_bytes
            self.counts[topic] += 1
            if self._waiting_bytes >= self._chunk_bytes:
                self._end_chunk()
            elif self._live:
                self._show()
                self._keep()
        except OSError as error:
            raise self._fail(error) from None

    def close(self, whole: bool = True) -> None:
        """Write what waits and the index, and close the file."""
        if self._closed:
            return
        self._closed = True
        try:
            self._end_chunk()
            self._file.cut(self._end)
            self._finish()
        except OSError as error:
            raise self._fail(error) from None
        try:
            self._file.close(whole)
        except OSError as error:
            raise self._file.give_up(error, self._count) from None

    def remove(self) -> None:
        self._file.remove()

    @abstractmethod
    def _begin(self, declared: Mapping[str, TopicDeclaration]) -> None:
        """Write the file's start."""

    @abstractmethod
    def _declare(self, topic: str, declared: TopicDeclaration) -> None:
        """Declare a topic, at the end of the file if it has to be written."""

    @abstractmethod
    def _append(self, topic: str, stamp_ns: int, data: Buffer, message: Any) -> None:
        """Add a message to the chunk: its bytes, and itself for other fields of its record."""

    @abstractmethod
    def _show(self) -> None:
        """Write the last message of the chunk at the end of the file."""

    @abstractmethod
    def _write_chunk(self, first_ns: int, last_ns: int) -> None:
        """Write the chunk, whose messages have stamps between these, and begin a new one."""

    @abstractmethod
    def _finish(self) -> None:
        """Write the records after the last chunk."""

    def _publisher(self, topic: TopicType) -> str:
        """The publisher of a topic, if known and a single node."""
        if len(topic.callerids) > 1:
            self._unplaced["publisher name"] += len(topic.callerids)
        return topic.callerids[0] if len(topic.callerids) == 1 else ""

    def _require_open(self) -> None:
        if self._closed:
            raise RecordingError(f"{self.path}: the recording has ended")

    def _write_between(self, write: Callable[[], object]) -> None:
        """Write records between two chunks."""
        try:
            self._end_chunk()
            self._file.cut(self._end)
            write()
            self._end = self._file.tell()
            self._keep()
        except OSError as error:
            raise self._fail(error) from None

    def _end_chunk(self) -> None:
        if not self._waiting:
            return
        first_ns, last_ns = min(self._waiting), max(self._waiting)
        self.start_ns, self.end_ns = min(self.start_ns, first_ns), max(self.end_ns, last_ns)
        self._file.cut(self._end)
        self._kept = self._chunked
        self._write_chunk(first_ns, last_ns)
        self._end = self._file.tell()
        self._chunked += len(self._waiting)
        self._waiting_bytes = 0
        self._waiting.clear()
        self._keep()

    @property
    def _count(self) -> int:
        """Number of messages so far."""
        return self._chunked + len(self._waiting)

    def _keep(self) -> None:
        self._file.keep()
        self._kept = self._count

    def _require_room(self, size: int) -> None:
        """Check that the disk has room for so many more bytes; called once in a while."""
        self._unchecked_bytes = 0
        waiting = self._waiting_bytes + _RECORD_BYTES * len(self._waiting)
        more = size + size // 128 + _CHECK_BYTES
        try:
            self._file.require_room(waiting + more + self._index_bytes)
        except OSError as error:
            self.close(whole=False)
            raise self._file.give_up(error, self._count) from None

    @property
    @abstractmethod
    def _index_bytes(self) -> int:
        """Size of what `_finish` writes."""

    def _fail(self, error: OSError) -> RecordingError:
        self._closed = True
        self._file.fail()
        return self._file.give_up(error, self._kept)
