"""Recording a running graph: the messages of all topics in order, into one file."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, RecordingError
from ros_visualise.core.params import Parameters, Value
from ros_visualise.core.printing import without_secrets
from ros_visualise.data import Header, ParameterEvent
from ros_visualise.data.fields import LATEST_NS
from ros_visualise.graph import Graph
from ros_visualise.runtime.calibrations import Calibrations, calibration_topics
from ros_visualise.runtime.ordering import Ordering, recordable
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.record_queue import ArrivalOrder, RecordQueue
from ros_visualise.runtime.refusals import Refusals
from ros_visualise.runtime.report import RecordingReport
from ros_visualise.sinks import PARAMETER_EVENTS, Recorder, open_recorder
from ros_visualise.sinks.parts import Split

log = logging.getLogger(__name__)

_HASTE_S = 0.2  # from then on, what is late is not compressed


def record(
    graph: Graph,
    parameters: Mapping[str, Parameters[Any]],
    path: str | Path,
    topics: Collection[str],
    overwrite: bool,
    lossless: bool,
    by_arrival: bool = False,
    split: Split | None = None,
) -> RecorderThread:
    """Begin a recording of a running graph, with the parameters of its nodes as they are now.

    Args:
        graph: what runs.
        parameters: node -> its parameters.
        path: the new file or folder.
        topics: those to record; none: as of `ros_visualise.sinks.open_recorder`.
        overwrite: whether the file may exist.
        lossless: see `RecorderThread`.
        by_arrival: see `RecorderThread`.
        split: as of `ros_visualise.sinks.open_recorder`.

    Raises:
        OpenError: it exists or cannot be written, or is being recorded already.
        UsageError: it names a topic that there is not, or no known kind of file.
    """
    recorder = open_recorder(
        path,
        recordable(graph),
        overwrite,
        [name for name, topic in graph.topics.items() if topic.on_demand],
        named=topics,
        beside=calibration_topics(graph),
        split=split,
    )
    recording = RecorderThread(recorder, graph, lossless, by_arrival)
    for node in graph.members:
        current = parameters[node.name].current
        recording.put_event(ParameterEvent(node.name, new=vars(current)))
    return recording


def report_recordings(recordings: Collection[RecorderThread]) -> dict[str, RecordingReport]:
    """File -> how much of it is there."""
    return {
        str(one.path): RecordingReport(one.written, one.dropped, one.refused, one.files)
        for one in recordings
    }


class TopicInbox:
    """Hands the packets of one topic to a recorder, as `ros_visualise.runtime.queues.Inbox`."""

    def __init__(self, recording: RecorderThread, topic: str) -> None:
        self._recording = recording
        self._topic = topic

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        self._recording.put(self._topic, packet)

    def close(self) -> None:
        """Nothing more comes."""
        self._recording.finish(self._topic)


class RecorderThread:
    """One file that is being written, on a thread of its own; before each image its calibration.

    Messages are written in the order and under the times of `Ordering`, so that the same input
    makes the same file however the threads run. One without messages replaces nothing.

    Args:
        recorder: writes the file, and is closed at the end.
        graph: what runs.
        lossless: whoever publishes waits while too much waits to be written; otherwise the message
            is dropped and counted, and what is late is written without compression.
        by_arrival: messages are written as they come, for nobody tells how they belong together.

    Attributes:
        error: what ended it early, if anything did.
        closing: nothing more is written, and the file is brought to its end.
        written: messages that were recorded.
        topics: those that are recorded.
        inboxes: topic -> where its packets go; also those of topics that numbers come from.
    """

    def __init__(
        self, recorder: Recorder, graph: Graph, lossless: bool, by_arrival: bool = False
    ) -> None:
        self.error: RecordingError | None = None
        self.closing = False
        self.written = 0
        self.topics = tuple(t for t in recordable(graph) if t in recorder.topics)
        order = Ordering(graph, self.topics)
        self.inboxes = {topic: TopicInbox(self, topic) for topic in order.inputs}
        self._queue = RecordQueue(
            ArrivalOrder() if by_arrival else order, lossless, str(recorder.path)
        )
        self._lossless = lossless
        self._recorder = recorder
        self._calibrations = Calibrations(graph, recorder)
        self._events: deque[ParameterEvent] = deque()
        self._written_ns = 0  # the log time of what was written last
        self._discarded = False
        self._refusals = Refusals(str(recorder.path))
        self.put, self.finish, self.missed = self._queue.put, self._queue.finish, self._queue.missed
        self._thread = supervision.start(str(recorder.path), self._write_all)

    @property
    def path(self) -> Path:
        """Where it is; see `ros_visualise.sinks.Recorder`."""
        return self._recorder.path

    @property
    def files(self) -> int:
        """How many files it is in by now."""
        return self._recorder.files

    @property
    def dropped(self) -> int:
        """Messages that were not recorded, for want of time or as the file cannot hold them."""
        return self._queue.dropped + self._refusals.count

    @property
    def refused(self) -> int:
        """Those of the dropped messages that the file cannot hold."""
        return self._refusals.count

    @property
    def has_ended(self) -> bool:
        """Whether its file is closed."""
        return not self._thread.is_alive()

    @property
    def is_open(self) -> bool:
        """Whether it still takes messages."""
        return not self._queue.stopped

    def put_event(self, event: ParameterEvent) -> None:
        """Record that parameters were set, at the time of the next message; no passwords."""
        if not self._queue.stopped:
            new, changed = (_without_secrets(values) for values in (event.new, event.changed))
            self._events.append(replace(event, new=new, changed=changed))

    def close(self) -> None:
        """Write what waits and close the file."""
        self._queue.stop()
        self._thread.join()

    def discard(self) -> None:
        """End it and delete what was written; what it was to replace stays."""
        self._discarded = True
        self.close()
        self._recorder.remove()

    def _write_all(self) -> None:
        try:
            while (found := self._queue.take()) is not None:
                self._recorder.unthrottled = not self._lossless and self._queue.late_s > _HASTE_S
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
        if 0 <= log_ns < LATEST_NS:  # else the events have to wait for the next message
            self._written_ns = log_ns
            self._write_events()
        try:
            if found := self._calibrations.find(topic, message):
                self.written += self._record(*found, log_ns)
        except DamagedMessage as error:
            self._refusals.add(topic, error)
        self.written += self._record(topic, message, log_ns)

    def _write_events(self) -> None:
        while self._events:
            event = replace(self._events.popleft(), header=Header(self._written_ns))
            self._record(PARAMETER_EVENTS, event)

    def _record(self, topic: str, message: Any, log_ns: int | None = None) -> bool:
        """Write one message; whether the file can hold it, which else is counted."""
        try:
            self._recorder.write(topic, message, log_ns)
        except DamagedMessage as error:
            self._refusals.add(topic, error)
            return False
        return True


def _without_secrets(values: Mapping[str, Value]) -> dict[str, Value]:
    return {
        name: without_secrets(value) if type(value) is str else value
        for name, value in values.items()
    }
