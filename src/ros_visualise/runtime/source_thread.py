"""The source of a graph on a thread of its own."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, ParameterError, RosVisualiseError
from ros_visualise.core.params import Parameters, Value, specs
from ros_visualise.core.rate import Steady
from ros_visualise.graph import SourceNode
from ros_visualise.messages.recorded import Recorded, content, recorded_ns
from ros_visualise.nodes import Source
from ros_visualise.runtime.counters import NodeCounter
from ros_visualise.runtime.ingress import Epochs
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.rejections import RejectedMessages, require_header
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.runner import make_state
from ros_visualise.runtime.topics import Topic
from ros_visualise.sources.playback import Playback

log = logging.getLogger(__name__)

_LOOK_S = 0.1


class SourceThread:
    """Publishes the messages of a source, which is reopened when a parameter requires it.

    Args:
        node: the source.
        parameters: its live parameters.
        playback: how it is played.
        outputs: output name -> topic.
        on_message: called before each message is published.
        on_published: called after that, with its number and topic.

    Attributes:
        error: the first; None without any.

    Raises:
        OpenError: the source cannot be opened.
    """

    def __init__(
        self,
        node: SourceNode,
        parameters: Parameters[Any],
        playback: Playback,
        outputs: Mapping[str, Topic],
        on_message: Callable[[], None],
        on_published: Callable[[int, str], None],
    ) -> None:
        self.error: BaseException | None = None
        self.name = node.name
        self._type = node.type
        self._parameters = parameters
        self._playback = playback
        self._outputs = outputs
        self._on_message, self._on_published = on_message, on_published
        self._topics = node.outputs
        self._counter = NodeCounter()
        self._rejected = RejectedMessages(node.name)
        self._steady = Steady()
        self._begun = self._reopened = 0
        self._reported: set[str] = set()
        self._epochs = Epochs(node.type.latched)
        self._given = self._opened_with = parameters.current
        self._source = self._open(self._given)
        self._swapping = threading.Lock()  # while the source is replaced
        self._is_opening = False
        parameters.accept = self._configure

    def run(self) -> None:
        """Run until the source ends or the playback is closed."""
        try:
            for work in (self._publish_all, self.report_lost):
                self._do(work)
        finally:
            for topic in self._outputs.values():
                topic.finish()

    def report(self) -> NodeReport:
        """Counts and the source's own figures, also of drops."""
        own: dict[str, Any] = {}
        try:
            own = dict(self._source.report())
        except supervision.ERRORS as error:
            supervision.note(self.name, error)
        dropped = dict(own.pop("dropped", {}))
        if self._rejected.count:
            dropped["error"] = dropped.get("error", 0) + self._rejected.count
        return replace(self._counter.report(), dropped=dropped, own=own)

    def report_lost(self) -> None:
        """Warn of unreadable parts, of each once."""
        for note in self.report().unread:
            if note not in self._reported:
                self._reported.add(note)
                log.warning("%s: %s", self.name, note)

    def act(self, name: str) -> None:
        """Run an action of the source."""
        getattr(self._source, name)()

    def receive(self, port: str, message: Any) -> None:
        """Hand a message to an input of the source."""
        self._source.receive(port, message)

    def publish(self, topic: str, message: Recorded) -> None:
        """Publish a message where the source comes from."""
        self._source.publish(topic, message)

    def awaits(self, port: str) -> bool:
        """True if the source needs the answers to its messages on an input."""
        return self._source.awaits(port)

    def close(self) -> None:
        """Close the source."""
        supervision.attempt(self.name, self._source.close)

    def _do(self, work: Callable[[], None]) -> None:
        try:
            work()
        except RosVisualiseError as error:
            log.error("%s", error)
            self.error = self.error or error
        except supervision.ERRORS as error:
            log.exception("%s broke", self.name)
            self.error = self.error or error

    def _publish_all(self) -> None:
        number = 0
        for port, message in self._messages():
            if not self._passes(port, message):
                continue
            arrival_ns = time.monotonic_ns()
            log_ns = self._log_ns(message, arrival_ns)
            epoch = self._epoch(port, message.header.stamp_ns, log_ns)
            packet = Packet(number, message, arrival_ns, log_ns=log_ns, epoch=epoch)
            self._counter.received = self._counter.processed = number + 1
            self._on_message()
            self._outputs[port].publish(packet)
            self._on_published(number, self._topics[port])
            number += 1

    def _passes(self, port: str, message: Any) -> bool:
        """True if a message is valid; otherwise it is rejected and counted."""
        try:
            if port not in self._outputs:
                raise DamagedMessage(f"not declared; outputs are {', '.join(self._outputs)}")
            require_header(message)
        except DamagedMessage as error:
            self._rejected.add(port, error)
            self.error = self.error or error
            return False
        return True

    def _epoch(self, port: str, stamp_ns: int, log_ns: int) -> int:
        """Number of jumps of time before this message, in the stamps, by seeks or by loops."""
        begun = self._playback.epoch + self._playback.laps + self._reopened
        if begun != self._begun:
            self._begun = begun
            self._epochs.begin()
        return self._epochs.of(port, stamp_ns, log_ns)

    def _log_ns(self, message: Any, arrival_ns: int) -> int:
        """Log time; live, it goes on evenly, even if the stamps' clock is set."""
        log_ns = recorded_ns(message)
        return self._steady.of(log_ns, arrival_ns) if self._type.live else log_ns

    def _messages(self) -> Iterator[tuple[str, Any]]:
        while True:
            yield from self._source.messages()
            if not self._playback.take_restart():
                return
            self._reopen()
            self._reopened += 1

    def _reopen(self) -> None:
        """Open the source with its present parameters, or return to the previous ones."""
        with self._swapping:
            self._is_opening, tried = True, self._given
        if self._type.live:
            self.close()  # a device can be opened only once
        try:
            source = self._open(tried)
        except RosVisualiseError as error:
            if _reopening(tried) == _reopening(self._opened_with):
                raise
            log.error("%s", error)
            if _reopening(tried) == _reopening(self._given):  # they were not changed meanwhile
                self._parameters.update(_reopening(self._opened_with))
        else:
            self._swap(source, tried)

    def _swap(self, source: Source, opened_with: Any) -> None:
        """Replace the source by one that was opened, with later changes."""
        with self._swapping:
            self.close()
            self._source, self._opened_with, self._is_opening = source, opened_with, False
            late = vars(self._given).items() - vars(opened_with).items()
            changed = {name: value for name, value in late if name not in _reopening(opened_with)}
            try:
                self._hand_over(self._given, changed)
                return
            except ParameterError as error:
                log.error("%s", error)
        self._parameters.update({name: getattr(opened_with, name) for name in changed})

    def _configure(self, current: Any, changed: Mapping[str, Value]) -> None:
        """Hand changed parameters to the source before they apply, or as soon as it is open."""
        with self._swapping:
            if not self._is_opening:
                self._hand_over(current, changed)
            self._given = current

    def _hand_over(self, current: Any, changed: Mapping[str, Value]) -> None:
        self._source.configure(current, changed)
        live = {n: value for n, value in changed.items() if n not in _reopening(current)}
        self._opened_with = replace(self._opened_with, **live)

    def _open(self, params: Any) -> Source:
        source: Source = make_state(self.name, lambda: self._type.make(params, self._playback))
        source.set_demand(lambda port: self._outputs[port].awaited)
        return source


class SourceInput:
    """Hands the messages of a topic to an input of the source, on the thread that publishes them.

    Args:
        source: takes them.
        port: the input.
        origins: topics of the source that this one is made from.
    """

    def __init__(self, source: SourceThread, port: str, origins: Collection[str]) -> None:
        self._source, self._port, self._origins = source, port, origins
        self._answered = -1
        self._closed = False
        self._changed = threading.Condition()

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        if packet.message is not None:
            self._source.receive(self._port, content(packet.message))
        with self._changed:
            self._answered = max(self._answered, packet.number - packet.more)
            self._changed.notify_all()

    def close(self) -> None:
        """Nothing more comes; the source goes on without answers."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def wait_for(
        self, number: int, topic: str, goes_on: Callable[[], bool], patience_s: float
    ) -> None:
        """Wait until the nodes have answered a message of the source, if it needs their answer.

        Args:
            number: of the message.
            topic: on which the source published it.
            goes_on: returns False to stop waiting.
            patience_s: longest time to wait.
        """
        if topic not in self._origins or not self._source.awaits(self._port):
            return
        latest_s = time.monotonic() + patience_s
        with self._changed:
            while self._answered < number and not self._closed and goes_on():
                if time.monotonic() > latest_s:
                    return
                self._changed.wait(_LOOK_S)


def _reopening(params: Any) -> dict[str, Value]:
    """Parameters whose change requires reopening a source."""
    return {spec.name: getattr(params, spec.name) for spec in specs(params) if spec.restart}
