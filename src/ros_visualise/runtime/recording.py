"""Recordings of a running graph: the messages of all topics, in one file."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, RecordingError, UsageError
from ros_visualise.core.params import Parameters, Value
from ros_visualise.core.printing import without_secrets
from ros_visualise.data import Header, ParameterEvent
from ros_visualise.data.fields import LATEST_NS
from ros_visualise.graph import Graph
from ros_visualise.runtime.calibrations import Calibrations, calibration_topics
from ros_visualise.runtime.ordering import Ordering, recordable
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.record_queue import ArrivalQueue, OrderedQueue
from ros_visualise.runtime.rejections import RejectedMessages
from ros_visualise.runtime.report import RecordingReport
from ros_visualise.runtime.topics import CallbackListener, Listener
from ros_visualise.sinks import PARAMETER_EVENTS, Recorder, open_recorder
from ros_visualise.sinks.parts import Split

log = logging.getLogger(__name__)

_LATE_S = 0.2  # later messages are not compressed


class RecorderThread:
    """One file that is being written, on a thread of its own; before each image its calibration.

    A lossless recording is written in the order and under the times of `Ordering`, so that the same
    input makes the same file however the threads run; others as messages arrive. A recording
    without messages replaces no file.

    Args:
        recorder: writes the file, and is closed at the end.
        graph: what runs.
        lossless: publishers wait while too much waits to be written; otherwise messages are dropped
            and counted, and late ones are written without compression.
        now_ns: gives the time of a foreign graph, nanoseconds; 0: messages have their own.

    Attributes:
        error: what ended it early, if anything did.
        closing: True while the file is being completed; nothing more is written.
        written: messages that were recorded.
        topics: those that are recorded.
        listeners: topic -> takes its packets; also of topics whose numbers give the order.
    """

    def __init__(
        self,
        recorder: Recorder,
        graph: Graph,
        lossless: bool,
        now_ns: Callable[[], int] = lambda: 0,
    ) -> None:
        self.error: RecordingError | None = None
        self.closing = False
        self.written = 0
        self.topics = tuple(t for t in recordable(graph) if t in recorder.topics)
        name, inputs = str(recorder.path), self.topics
        self._queue = ArrivalQueue(graph.topics.keys() & inputs, name, now_ns)
        if lossless:
            order = Ordering(graph, self.topics)
            self._queue, inputs = OrderedQueue(order, name), order.inputs
        self.put, self.finish, self.missed = self._queue.put, self._queue.finish, self._queue.missed
        self.listeners: dict[str, Listener] = {
            topic: CallbackListener(partial(self.put, topic), partial(self.finish, topic))
            for topic in inputs
        }
        self._lossless = lossless
        self._recorder = recorder
        self._calibrations = Calibrations(graph, recorder)
        self._events: deque[ParameterEvent] = deque()
        self._written_ns = 0  # log time of the message written last
        self._discarded = False
        self._rejected = RejectedMessages(name)
        self._thread = supervision.start(name, self._write_all)

    @property
    def path(self) -> Path:
        """Path of the file or folder."""
        return self._recorder.path

    @property
    def files(self) -> int:
        """Number of files written so far."""
        return self._recorder.files

    @property
    def dropped(self) -> int:
        """Messages not recorded: writing was too slow, or the file cannot hold them."""
        return self._queue.dropped + self._rejected.count

    @property
    def refused(self) -> int:
        """Dropped messages that the file cannot hold."""
        return self._rejected.count

    @property
    def has_ended(self) -> bool:
        """True if its file is closed."""
        return not self._thread.is_alive()

    @property
    def is_open(self) -> bool:
        """True if it still takes messages."""
        return not self._queue.stopped

    def put_event(self, event: ParameterEvent) -> None:
        """Record a change of parameters at the time of the next message, without passwords."""
        if not self._queue.stopped:
            new, changed = (_without_secrets(values) for values in (event.new, event.changed))
            self._events.append(replace(event, new=new, changed=changed))

    def close(self) -> None:
        """Write the messages that wait, and close the file."""
        self._queue.stop()
        self._thread.join()

    def discard(self) -> None:
        """End it and delete what was written; a file that it would have replaced stays."""
        self._discarded = True
        self.close()
        self._recorder.remove()

    def _write_all(self) -> None:
        try:
            while (found := self._queue.take()) is not None:
                self._recorder.unthrottled = not self._lossless and self._queue.late_s > _LATE_S
                self._write(*found)
            self._write_events()
            self.closing = True
            self._recorder.close(whole=self.written > 0 and not self._discarded)
        except RecordingError as error:
            self._fail(error)
        except Exception as error:
            log.exception("%s broke", self.path)
            self._fail(RecordingError(f"{self.path}: {error}"))
        finally:
            self.closing = False
            self._queue.stop()

    def _fail(self, error: RecordingError) -> None:
        log.error("%s", error)
        self.error = error
        self._recorder.close(whole=False)

    def _write(self, topic: str, packet: Packet) -> None:
        message, log_ns = packet.message, packet.log_ns
        assert log_ns is not None
        if 0 <= log_ns < LATEST_NS:  # otherwise the events wait for the next message
            self._written_ns = log_ns
            self._write_events()
        try:
            if found := self._calibrations.find(topic, message):
                self.written += self._record(*found, log_ns)
        except DamagedMessage as error:
            self._rejected.add(topic, error)
        self.written += self._record(topic, message, log_ns)

    def _write_events(self) -> None:
        while self._events:
            event = replace(self._events.popleft(), header=Header(self._written_ns))
            self._record(PARAMETER_EVENTS, event)

    def _record(self, topic: str, message: Any, log_ns: int | None = None) -> bool:
        """Write one message; False, with the rejection counted, if the file cannot hold it."""
        try:
            self._recorder.write(topic, message, log_ns)
        except DamagedMessage as error:
            self._rejected.add(topic, error)
            return False
        return True

    def report(self) -> RecordingReport:
        """Its counts."""
        return RecordingReport(self.written, self.dropped, self.refused, self.files)


class Recordings:
    """The recordings of a runtime, until it ends.

    Args:
        connect: connects a new recording to the topics that it records.
        disconnect: disconnects it again.
    """

    def __init__(
        self,
        connect: Callable[[RecorderThread], None],
        disconnect: Callable[[RecorderThread], None],
    ) -> None:
        self._all: list[RecorderThread] = []
        self._connect, self._disconnect = connect, disconnect
        self._ended = False
        self._lock = threading.Lock()

    def __iter__(self) -> Iterator[RecorderThread]:
        return iter(tuple(self._all))

    def start(
        self,
        graph: Graph,
        parameters: Mapping[str, Parameters[Any]],
        path: str | Path,
        overwrite: bool,
        topics: Collection[str],
        split: Split | None,
        lossless: bool = False,
        now_ns: Callable[[], int] = lambda: 0,
    ) -> RecorderThread:
        """Begin a recording of a graph, with the present parameters of its nodes.

        Args:
            graph: what runs.
            parameters: node -> its parameters.
            path, overwrite, topics, split: as of `ros_visualise.sinks.open_recorder`.
            lossless, now_ns: as of `RecorderThread`.

        Raises:
            OpenError: the file exists, cannot be written, or is already being recorded.
            UsageError: unknown topic or kind of file, or the run has ended.
        """
        with self._lock:
            if self._ended:
                raise UsageError(f"{path}: the run has ended; nothing to record")
            recorder = open_recorder(
                path,
                recordable(graph),
                overwrite,
                [name for name, topic in graph.topics.items() if topic.on_demand],
                named=topics,
                beside=calibration_topics(graph),
                split=split,
            )
            recording = RecorderThread(recorder, graph, lossless, now_ns)
            self._all.append(recording)
        for node in graph.members:
            current = parameters[node.name].current
            recording.put_event(ParameterEvent(node.name, new=vars(current)))
        try:
            self._connect(recording)
        except BaseException:
            self.stop(recording)
            recording.discard()
            self._all.remove(recording)
            raise
        return recording

    def stop(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        recording.close()
        self._disconnect(recording)

    def end(self) -> None:
        """Stop all recordings, and begin no more."""
        with self._lock:
            self._ended = True
        for recording in self:
            self.stop(recording)

    def put_event(self, event: ParameterEvent) -> None:
        """Record a change of parameters in all of them."""
        for recording in self:
            recording.put_event(event)

    def report(self) -> dict[str, RecordingReport]:
        """File -> the counts of its recording."""
        return {str(one.path): one.report() for one in self}


def _without_secrets(values: Mapping[str, Value]) -> dict[str, Value]:
    return {
        name: without_secrets(value) if type(value) is str else value
        for name, value in values.items()
    }
