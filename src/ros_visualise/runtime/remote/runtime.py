"""The runtime of nodes in other processes: what a graph has, to look at and to tune."""

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
from ros_visualise.core.params import Parameters, Value
from ros_visualise.data import Image, ParameterEvent
from ros_visualise.graph import Graph, TopicSpec
from ros_visualise.messages import type_name
from ros_visualise.messages.recorded import TopicType
from ros_visualise.nodes import NoParams
from ros_visualise.runtime.entrance import Numbering
from ros_visualise.runtime.memory import tend_memory
from ros_visualise.runtime.middleware import Publisher, Transport
from ros_visualise.runtime.queues import Inbox
from ros_visualise.runtime.recording import RecorderThread, record, report_recordings
from ros_visualise.runtime.remote.discovery import Sight, survey
from ros_visualise.runtime.remote.figures import Figures
from ros_visualise.runtime.remote.parameters import RemoteParameters
from ros_visualise.runtime.remote.places import Place, places, to_graph
from ros_visualise.runtime.remote.relay import Arrivals, Relay
from ros_visualise.runtime.report import RunReport, TopicReport
from ros_visualise.runtime.topics import Subscription
from ros_visualise.sinks.parts import Split

log = logging.getLogger(__name__)

_LOOK_S = 0.5
_PATIENCE_S = 1.0
"""For so long a new node is waited for to tell of its parameters, before it is shown without."""
_CLOSE_S = 1.0
_REMEMBERED = 50
"""So many nodes that have gone are followed, as they may come back."""


class RemoteRuntime:
    """Looks at nodes elsewhere on the graph; see `ros_visualise.runtime.base.Runtime`.

    ``graph`` is another object as soon as nodes or topics have come or gone; ``parameters`` keeps
    the last of those that have gone.

    Args:
        transport: what they are reached by.
        compressed: whether images come compressed, where somebody publishes them so.
    """

    playback = None

    def __init__(self, transport: Transport, compressed: bool = False) -> None:
        self._transport = transport
        self.name = transport.resolve("~")
        self.graph = Graph(None, ())
        self.parameters: dict[str, Parameters[Any]] = {}
        self._met: dict[str, Parameters[Any]] = {}
        self._compressed = compressed
        self._sight = Sight((), {}, {}, frozenset())
        self._figures = Figures(transport)
        self._key: object = None
        self._seen_s: dict[str, float] = {}
        self._numbering = Numbering()
        self._relays: dict[str, Relay] = {}
        self._recordings: dict[RecorderThread, Arrivals] = {}
        self._publishers: dict[str, Publisher] = {}
        self._recording = threading.Lock()
        self._lock = threading.Lock()
        self._closed = threading.Event()
        tend_memory()
        self._look()
        self._thread = supervision.start("discovery", self._follow, again_s=_LOOK_S)

    @property
    def told(self) -> Mapping[str, type]:
        """The topics on which nodes log, and tell how they are."""
        return self._sight.told

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic, beginning with its last message if it was looked at before."""
        inbox = Inbox(lossless=False, keep=depth)
        relay = self._relay(topic)
        relay.connect(inbox, self._comes_compressed(topic), latched=True)
        return Subscription(topic, inbox, partial(relay.disconnect, inbox))

    def publish(self, topic: str, message: Any) -> None:
        """Publish to whoever listens on the graph."""
        if topic not in self._publishers:
            kind = TopicType(type_name(type(message)))
            self._publishers[topic] = self._transport.advertise(topic, kind)
        self._publishers[topic].publish(message)

    def act(self, node: str, action: str) -> None:
        """Run an action of a node, by its service.

        Raises:
            RosVisualiseError: it cannot be asked, or did not do it.
        """
        self._transport.call(f"/{node}/{action}")

    def report(self, window_s: float | None = None) -> RunReport:
        """The run report: our nodes' own figures, and the rates of what is received here."""
        graph = self.graph
        nodes = {node.name: self._figures.node(f"/{node.name}") for node in graph.nodes}
        topics = {
            name: self._topic_report(name, topic, window_s) for name, topic in graph.topics.items()
        }
        recordings = report_recordings(tuple(self._recordings))
        return RunReport(topics, nodes, recordings, self._sight.unknown)

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> RecorderThread:
        """Record the topics that there are now, in the order and at the times of arrival.

        Raises:
            OpenError: it exists or cannot be written.
            UsageError: it names a topic that there is not, or no known kind of file; or this has
                been closed.
        """
        with self._recording:
            if self._closed.is_set():
                raise UsageError(f"{path}: the viewer is ending, so there is nothing to record")
            recording = record(
                self.graph,
                self.parameters,
                path,
                topics,
                overwrite,
                lossless=False,
                by_arrival=True,
                split=split,
            )
            clock, dropped = self._transport.clock(), self._dropped
            arrivals = self._recordings[recording] = Arrivals(recording, clock, dropped)
        try:
            self._connect(recording, arrivals)
        except BaseException:
            self.stop_recording(recording)
            recording.discard()
            del self._recordings[recording]
            raise
        return recording

    def _connect(self, recording: RecorderThread, arrivals: Arrivals) -> None:
        """Subscribe to what is recorded; a topic that cannot be is said, and others are recorded.

        Raises:
            UsageError: none of them can be.
        """
        failed: list[str] = []
        for topic, inbox in arrivals.inboxes.items():
            try:
                self._relay(topic).connect(inbox, self._comes_compressed(topic))
            except RosVisualiseError as error:
                failed.append(f"{topic}: {error}")
                log.warning("%s: %s is not recorded: %s", recording.path, topic, error)
        if failed and len(failed) == len(arrivals.inboxes):
            raise UsageError(f"{recording.path}: nothing to record: {'; '.join(failed)}")

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        for topic, inbox in self._recordings[recording].inboxes.items():
            self._relay(topic).disconnect(inbox)
        recording.close()

    def close(self) -> None:
        """Look no longer; all recordings are closed."""
        with self._recording:
            self._closed.set()
        for recording in tuple(self._recordings):
            self.stop_recording(recording)
        self._thread.join(_CLOSE_S)
        for relay in tuple(self._relays.values()):
            relay.close()
        for parameters in tuple(self._met.values()):
            if isinstance(parameters, RemoteParameters):
                parameters.close()
        self._figures.close()

    def _follow(self) -> None:
        while not self._closed.wait(_LOOK_S):
            self._look()

    def _look(self) -> None:
        """See who is there; the graph changes only if something about it has."""
        try:
            self._sight = survey(self._transport.listing(), self.name)
        except Unreachable as error:
            log.debug("the graph cannot be looked at: %s", error)
            return
        found = [place for peer in self._sight.peers for place in places(peer, self._figures)]
        self._meet(found)
        self._forget_gone({place.name for place in found})
        shown = [place for place in found if self._is_settled(place)]
        types = self._sight.types
        key = [(place, type(self._met[place.name].current)) for place in shown], types
        if key != self._key:
            self.parameters |= {place.name: self._met[place.name] for place in shown}
            self._key, self.graph = key, to_graph(shown, self.parameters, types)
        for parameters in self._met.values():
            if isinstance(parameters, RemoteParameters):
                parameters.follow()

    def _meet(self, found: Iterable[Place]) -> None:
        """Get to know the parameters of whoever is new."""
        for place in found:
            known = self._met.get(place.name)
            if place.has_parameters and not isinstance(known, RemoteParameters):
                remote = RemoteParameters(self._transport, place.path)
                remote.on_change(partial(self._parameters_changed, place.name))
                self._met[place.name] = remote
                self._seen_s[place.name] = time.monotonic()
            elif known is None:
                self._met[place.name] = Parameters(NoParams())

    def _forget_gone(self, there: AbstractSet[str]) -> None:
        """Follow no longer those that have gone, but for the last ones: each has a thread."""
        for name in there & self._met.keys():
            self._met[name] = self._met.pop(name)  # now the last
        gone = [name for name in self._met if name not in there]
        for name in gone[:-_REMEMBERED]:
            forgotten = self._met.pop(name)
            self._seen_s.pop(name, None)
            self.parameters = {n: one for n, one in self.parameters.items() if n != name}
            if isinstance(forgotten, RemoteParameters):
                forgotten.close()

    def _is_settled(self, place: Place) -> bool:
        parameters = self._met[place.name]
        if not isinstance(parameters, RemoteParameters) or parameters.wait(0):
            return True
        return time.monotonic() - self._seen_s[place.name] > _PATIENCE_S

    def _topic_report(self, name: str, topic: TopicSpec, window_s: float | None) -> TopicReport:
        """What is received here; where nobody looks, how often its publisher says to publish."""
        relay = self._relay(name)
        report = relay.report(topic.ros.name, window_s)
        if relay.is_open:
            return report
        hz, wall_hz = self._figures.rates(f"/{topic.publisher}", name)
        return replace(report, hz=hz, wall_hz=wall_hz)

    def _parameters_changed(self, name: str, _: Any, changed: Mapping[str, Value]) -> None:
        for recording in tuple(self._recordings):
            recording.put_event(ParameterEvent(name, changed=changed))

    def _dropped(self, topic: str) -> int:
        return self._relay(topic).dropped

    def _relay(self, topic: str) -> Relay:
        with self._lock:
            if topic not in self._relays:
                types = {**self._sight.told, **self._sight.types}
                kind = types.get(topic, Image)
                self._relays[topic] = Relay(self._transport, topic, kind, self._numbering)
            return self._relays[topic]

    def _comes_compressed(self, topic: str) -> bool:
        return self._compressed and topic in self._sight.compressed
