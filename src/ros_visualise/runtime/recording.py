"""Recording a running graph: puts the messages of all topics in order and writes them."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from ros_visualise.data import Header, Image, ParameterEvent, Path, PointCloud
from ros_visualise.errors import DamagedMessage, RecordingError
from ros_visualise.graph import Graph
from ros_visualise.messages import type_name
from ros_visualise.messages.recorded import Recorded, TopicType, recorded_ns
from ros_visualise.runtime.calibrations import Calibrations
from ros_visualise.runtime.queues import END, Packet
from ros_visualise.sinks import PARAMETER_EVENTS, Recorder

log = logging.getLogger(__name__)

_FINISHED = 2**63
_MAX_PENDING_BYTES = 64 * 2**20


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

    Messages are written by the number that the source gave them and then by the order of the nodes,
    so that the same input makes the same file however the threads run. A message is written as soon
    as every recorded node has answered its number, if that number went to it; what nodes say at the
    end, when all have ended.

    What was made of a recorded message is written under the time under which that is recorded, its
    log time, whatever the stamps say; what nodes say at the end, and what the source is told from
    outside the graph, under the newest.

    ``lossless``: whoever publishes waits while too much is pending; otherwise the message is
    dropped and counted.

    Attributes:
        error: what ended it early, if anything did.
        path: the file.
        written: messages that were recorded.
        dropped: messages that were not.
        inboxes: topic -> where its packets go; also those of topics that numbers come from.
    """

    def __init__(self, recorder: Recorder, graph: Graph, lossless: bool) -> None:
        self.error: RecordingError | None = None
        self.dropped = 0
        self.lossless = lossless
        self.path = recorder.path
        self.written = 0
        self.topics = tuple(t for t in recordable(graph) if t in recorder.topics)
        self._told = _told(graph)
        self._followers = _followers(graph, self.topics)
        self.inboxes = {t: TopicInbox(self, t) for t in (*self._followers, *self.topics)}
        self._recorder = recorder
        self._calibrations = Calibrations(graph, recorder)
        self._pending_bytes = 0
        self._pending: dict[str, deque[Packet]] = {t: deque() for t in self.topics}
        self._order = {topic: place for place, topic in enumerate(self.topics)}
        self._answered = {t: -1 for t in self.inboxes if t not in self._told}
        self._owed: dict[str, deque[int]] = {t: deque() for t in self.inboxes}
        self._begun = -1  # the newest number that came from a source
        self._begun_ns: int | None = None  # and its log time
        self._events: deque[ParameterEvent] = deque()
        self._written_ns = 0  # the log time of what was written last
        self._stopped = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._write_all, name=str(recorder.path))
        self._thread.start()

    @property
    def is_open(self) -> bool:
        """Whether it still takes messages."""
        return not self._stopped

    def put(self, topic: str, packet: Packet) -> None:
        """Take the publisher's answer for one number, or what the source is told."""
        pending = self._pending.get(topic)
        with self._changed:
            while self.lossless and self._is_full(pending, packet) and not self._stopped:
                self._changed.wait()
            if self._stopped:
                return
            if topic in self._told:
                packet = packet._replace(number=max(self._begun, 0), log_ns=self._begun_ns)
            else:
                self._count(topic, packet)
            if pending is not None and packet.message is not None:
                self._keep(pending, packet)
            self._changed.notify_all()

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic."""
        with self._changed:
            self._answered[topic] = _FINISHED
            self._owed[topic].clear()
            self._changed.notify_all()

    def put_event(self, event: ParameterEvent) -> None:
        """Record that parameters were set, at the time of the next message."""
        if not self._stopped:
            self._events.append(event)

    def close(self) -> None:
        """Write what is pending and close the file."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()
        self._thread.join()

    def _write_all(self) -> None:
        try:
            while (found := self._next()) is not None:
                self._write(*found)
            self._write_events()
            self._recorder.close()
        except RecordingError as error:
            self._fail(error)
        except Exception as error:
            log.exception("%s broke", self.path)
            self._fail(RecordingError(f"{self.path}: {error}"))
        finally:
            with self._changed:
                self._stopped = True
                self._changed.notify_all()

    def _fail(self, error: RecordingError) -> None:
        log.error("%s", error)
        self.error = error
        self._recorder.close()

    def _count(self, topic: str, packet: Packet) -> None:
        """Note who owes an answer to this number, or that it was given."""
        number = packet.number
        self._answered[topic] = max(self._answered[topic], number)
        if topic in self._followers:
            self._begun, self._begun_ns = max(self._begun, number), packet.log_ns
            for follower in self._followers[topic]:
                if self._answered[follower] < number:
                    self._owed[follower].append(number)
        owed = self._owed[topic]
        while owed and owed[0] <= number:
            owed.popleft()

    def _keep(self, pending: deque[Packet], packet: Packet) -> None:
        if self._is_full(pending, packet):
            self.dropped += 1
        else:
            pending.append(packet)
            self._pending_bytes += _size(packet.message)

    def _is_full(self, pending: deque[Packet] | None, packet: Packet) -> bool:
        """Too much waits; but a topic of which nothing waits, or that ends, holds back others."""
        if not pending or packet.number == END:
            return False
        return self._pending_bytes >= _MAX_PENDING_BYTES

    def _next(self) -> tuple[str, Any, int] | None:
        """The next message in order, its topic and log time; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._first_ready() or self._is_over())
            topic = self._first_ready()
            if topic is None:
                return None
            packet = self._pending[topic].popleft()
            self._pending_bytes -= _size(packet.message)
            self._changed.notify_all()
            return topic, packet.message, self._log_ns(packet)

    def _log_ns(self, packet: Packet) -> int:
        is_new = packet.log_ns is None or packet.number == END
        found_ns = self._begun_ns if is_new else packet.log_ns
        return recorded_ns(packet.message) if found_ns is None else found_ns

    def _first_ready(self) -> str | None:
        waiting = [
            (self._pending[t][0].number, self._order[t], t) for t in self.topics if self._pending[t]
        ]
        if not waiting:
            return None
        number, _, topic = min(waiting)
        return topic if self._stopped or self._is_answered(number) else None

    def _is_answered(self, number: int) -> bool:
        """Whether nothing can come any more that belongs before this number, or to it."""
        if number == END:
            return min(self._answered.values()) == _FINISHED
        if any(owed and owed[0] <= number for owed in self._owed.values()):
            return False
        return number <= self._begun or all(self._answered[t] == _FINISHED for t in self._followers)

    def _is_over(self) -> bool:
        return self._stopped or min(self._answered.values(), default=_FINISHED) == _FINISHED

    def _write(self, topic: str, message: Any, log_ns: int) -> None:
        self._written_ns = log_ns
        self._write_events()
        try:
            if found := self._calibrations.find(topic, message):
                self._recorder.write(*found, log_ns)
                self.written += 1
            self._recorder.write(topic, message, log_ns)
            self.written += 1
        except DamagedMessage as error:
            self.dropped += 1
            log.warning("%s: %s: %s", self.path, topic, error)

    def _write_events(self) -> None:
        while self._events:
            event = replace(self._events.popleft(), header=Header(self._written_ns))
            self._recorder.write(PARAMETER_EVENTS, event)


def recordable(graph: Graph) -> dict[str, TopicType]:
    """What of a graph can be recorded: its topics, and those by which its source is told."""
    return {name: topic.ros for name, topic in graph.topics.items()} | _told(graph)


def _told(graph: Graph) -> dict[str, TopicType]:
    """Topics from outside the graph that its source listens to, as velocities for a robot."""
    heard = graph.source.inputs.values() if graph.source else ()
    inputs = graph.inputs
    return {topic: TopicType(type_name(inputs[topic])) for topic in heard if topic in inputs}


def _followers(graph: Graph, recorded: Collection[str]) -> dict[str, list[str]]:
    """Topics that numbers come from -> the recorded topics that are made from them."""
    begins = graph.inputs.keys() - _told(graph).keys()
    if graph.source is not None:
        begins |= set(graph.source.outputs.values())
    origins = {topic: {topic} for topic in begins}
    for node in graph.nodes:
        if node is not graph.source:
            made_from = set().union(*(origins.get(topic, set()) for topic in node.inputs.values()))
            origins |= {topic: made_from for topic in node.outputs.values()}
    return {
        begin: [t for t in recorded if t not in begins and begin in origins.get(t, set())]
        for begin in sorted(begins)
    }


def _size(message: Any) -> int:
    return message.nbytes if isinstance(message, Image | Path | PointCloud | Recorded) else 0
