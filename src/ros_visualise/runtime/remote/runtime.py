"""The runtime of remote nodes: a graph to look at and to tune."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Collection, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import RosVisualiseError, Unreachable, UsageError
from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters, Value
from ros_visualise.data import Image, ParameterEvent
from ros_visualise.graph import Graph, TopicSpec
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.nodes import NoParams
from ros_visualise.runtime.diagnostics import DiagnosticsReader
from ros_visualise.runtime.ingress import Numbering
from ros_visualise.runtime.memory import manage_memory
from ros_visualise.runtime.middleware import Publisher, Transport
from ros_visualise.runtime.queues import Inbox
from ros_visualise.runtime.recording import RecorderThread, Recordings
from ros_visualise.runtime.remote.graph_snapshot import (
    GraphSnapshot,
    RemoteNode,
    snapshot,
    to_graph,
)
from ros_visualise.runtime.remote.parameters import RemoteParameters
from ros_visualise.runtime.remote.relay import Relay, arrival_listener, steady_time
from ros_visualise.runtime.report import OutputReport, RunReport, TopicReport
from ros_visualise.runtime.topics import Listener, Subscription
from ros_visualise.sinks.parts import Split

log = logging.getLogger(__name__)

_LOOK_S = 0.5
_PATIENCE_S = 1.0
"""Longest time that a new node may take to report its parameters; then it is shown without."""
_CLOSE_S = 1.0
_REMEMBERED = 50
"""Number of ended nodes that are still followed, as they may return."""


class RemoteRuntime:
    """Shows remote nodes of a graph; see `ros_visualise.runtime.base.Runtime`.

    ``graph`` is another object as soon as nodes or topics have come or gone; ``parameters`` keeps
    the last ones of ended nodes.

    Args:
        transport: of the graph.
        compressed: subscribe to compressed images, if they are published.
    """

    playback = None
    publishes = True

    def __init__(self, transport: Transport, compressed: bool = False) -> None:
        self._transport = transport
        self.name = transport.resolve("~")
        self.graph = Graph(None, ())
        self.parameters: dict[str, Parameters[Any]] = {}
        self._met: dict[str, Parameters[Any]] = {}
        self._compressed = compressed
        self._snapshot = GraphSnapshot()
        self._reports = DiagnosticsReader(transport)
        self._key: object = None
        self._seen_s: dict[str, float] = {}
        self._numbering = Numbering()
        self._relays: dict[str, Relay] = {}
        self._recordings = Recordings(self._connect, self._disconnect)
        self._listeners: dict[RecorderThread, dict[str, Listener]] = {}
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._lock = threading.Lock()
        self._closed = threading.Event()
        manage_memory()
        self._look()
        self._thread = supervision.start("discovery", self._follow, again_s=_LOOK_S)

    @property
    def diagnostic_topics(self) -> Mapping[str, type[Message]]:
        """Topics of logs and diagnostics, with their types."""
        return self._snapshot.diagnostics

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic, beginning with its last message if it was subscribed before."""
        inbox = Inbox(lossless=False, keep=depth)
        relay = self._relay(topic)
        relay.connect(inbox, self._comes_compressed(topic), latched=True)
        return Subscription(topic, inbox, partial(relay.disconnect, inbox))

    def publish(self, topic: str, message: Any) -> None:
        """Publish on a topic of the graph."""
        key = topic, message.type_name
        if key not in self._publishers:
            definitions = message.definitions if isinstance(message, Recorded) else None
            kind = TopicType(message.type_name, definitions)
            self._publishers[key] = self._transport.advertise(topic, kind)
        self._publishers[key].publish(message)

    def act(self, node: str, action: str) -> None:
        """Run an action of a node, by its service.

        Raises:
            RosVisualiseError: it does not answer, or reports a failure.
        """
        self._transport.call(f"/{node}/{action}")

    def report(self, window_s: float | None = None) -> RunReport:
        """The run report: figures of our own nodes, and rates of received topics."""
        graph = self.graph
        nodes = {node.name: self._reports.report(f"/{node.name}") for node in graph.nodes}
        topics = {
            name: self._topic_report(name, topic, window_s) for name, topic in graph.topics.items()
        }
        return RunReport(topics, nodes, self._recordings.report(), self._snapshot.unknown)

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> RecorderThread:
        """Record the present topics, in the order and under the times of arrival."""
        now_ns = steady_time(self._transport.clock())
        return self._recordings.start(
            self.graph, self.parameters, path, overwrite, topics, split, now_ns=now_ns
        )

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        self._recordings.stop(recording)

    def _connect(self, recording: RecorderThread) -> None:
        """Subscribe to what is recorded; a topic that fails is skipped with a warning.

        Raises:
            UsageError: all of them fail.
        """
        listeners = self._listeners[recording] = {}
        failed: list[str] = []
        for topic in recording.topics:
            relay = self._relay(topic)
            listener = arrival_listener(recording, topic, relay)
            try:
                relay.connect(listener, self._comes_compressed(topic))
                listeners[topic] = listener
            except RosVisualiseError as error:
                failed.append(f"{topic}: {error}")
                log.warning("%s: %s is not recorded: %s", recording.path, topic, error)
        if failed and not listeners:
            raise UsageError(f"{recording.path}: nothing to record: {'; '.join(failed)}")

    def _disconnect(self, recording: RecorderThread) -> None:
        for topic, listener in self._listeners.pop(recording, {}).items():
            self._relay(topic).disconnect(listener)

    def close(self) -> None:
        """Close all recordings and subscriptions."""
        self._closed.set()
        self._recordings.end()
        self._thread.join(_CLOSE_S)
        for relay in tuple(self._relays.values()):
            relay.close()
        for parameters in tuple(self._met.values()):
            if isinstance(parameters, RemoteParameters):
                parameters.close()
        self._reports.close()

    def _follow(self) -> None:
        while not self._closed.wait(_LOOK_S):
            self._look()

    def _look(self) -> None:
        """Take a snapshot; ``graph`` is replaced only if something has changed."""
        try:
            self._snapshot = snapshot(self._transport.listing(), self.name)
        except Unreachable as error:
            log.debug("cannot list the graph: %s", error)
            return
        found = [node for one in self._snapshot.nodes for node in one.split(self._reports)]
        self._meet(found)
        self._forget_gone({node.name for node in found})
        shown = [node for node in found if self._is_settled(node)]
        types = self._snapshot.types
        key = [(node, type(self._met[node.name].current)) for node in shown], types
        if key != self._key:
            self.parameters |= {node.name: self._met[node.name] for node in shown}
            self._key, self.graph = key, to_graph(shown, self.parameters, types)
        for parameters in self._met.values():
            if isinstance(parameters, RemoteParameters):
                parameters.follow()

    def _meet(self, found: Iterable[RemoteNode]) -> None:
        """Follow the parameters of new nodes."""
        for node in found:
            known = self._met.get(node.name)
            if node.parameters and not isinstance(known, RemoteParameters):
                remote = RemoteParameters(self._transport, node.path)
                remote.on_change(partial(self._parameters_changed, node.name))
                self._met[node.name] = remote
                self._seen_s[node.name] = time.monotonic()
            elif known is None:
                self._met[node.name] = Parameters(NoParams())

    def _forget_gone(self, there: AbstractSet[str]) -> None:
        """Stop following ended nodes, except for the last ones: each has a thread."""
        for name in there & self._met.keys():
            self._met[name] = self._met.pop(name)  # now the last
        gone = [name for name in self._met if name not in there]
        for name in gone[:-_REMEMBERED]:
            forgotten = self._met.pop(name)
            self._seen_s.pop(name, None)
            self.parameters = {n: one for n, one in self.parameters.items() if n != name}
            if isinstance(forgotten, RemoteParameters):
                forgotten.close()

    def _is_settled(self, node: RemoteNode) -> bool:
        parameters = self._met[node.name]
        if not isinstance(parameters, RemoteParameters) or parameters.wait(0):
            return True
        return time.monotonic() - self._seen_s[node.name] > _PATIENCE_S

    def _topic_report(self, name: str, topic: TopicSpec, window_s: float | None) -> TopicReport:
        """The report of a received topic; of others, with the rates that the publisher reports."""
        relay = self._relay(name)
        report = relay.report(topic.ros.name, window_s)
        if relay.is_open:
            return report
        output = self._reports.report(f"/{topic.publisher}").outputs.get(name, OutputReport())
        return replace(report, hz=output.hz, wall_hz=output.wall_hz)

    def _parameters_changed(self, name: str, _: Any, changed: Mapping[str, Value]) -> None:
        self._recordings.put_event(ParameterEvent(name, changed=changed))

    def _relay(self, topic: str) -> Relay:
        with self._lock:
            if topic not in self._relays:
                types = {**self._snapshot.diagnostics, **self._snapshot.types}
                kind = types.get(topic, Image)
                self._relays[topic] = Relay(self._transport, topic, kind, self._numbering)
            return self._relays[topic]

    def _comes_compressed(self, topic: str) -> bool:
        return self._compressed and topic in self._snapshot.compressed
