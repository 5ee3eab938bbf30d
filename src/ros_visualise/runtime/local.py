"""The runtime with no ROS: every node is a thread of one process, images pass by reference."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.data import ParameterEvent
from ros_visualise.errors import RosVisualiseError, UsageError
from ros_visualise.messages import type_name
from ros_visualise.nodes import Source, SourceType
from ros_visualise.params import Parameters, Value, specs
from ros_visualise.pipelines import Graph, Node
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.recording import RecorderThread
from ros_visualise.runtime.runner import NOTHING, NodeRunner
from ros_visualise.runtime.stats import NodeStats
from ros_visualise.runtime.topics import Subscription, Topic
from ros_visualise.sinks import open_recorder, parse_target
from ros_visualise.sources.playback import Playback

log = logging.getLogger(__name__)

_STOP_TIMEOUT_S = 1.0


class LocalRuntime:
    """Runs a graph in this process; see `ros_visualise.runtime.base.Runtime`.

    Args:
        graph: what to run.
        playback: how its source is played. At rate 0, and while it is recorded, no node drops what
            it has no time for: the source waits instead, unless it is live.

    Raises:
        OpenError: the source cannot be opened.
    """

    def __init__(self, graph: Graph, playback: Playback) -> None:
        assert isinstance(graph.source.type, SourceType)
        self.graph = graph
        self.playback = playback
        self._source_type = graph.source.type
        self.parameters: Mapping[str, Parameters[Any]] = {
            node.name: Parameters(node.params) for node in graph.nodes
        }
        self._lossless = False
        self._topics = {name: Topic(topic.on_demand) for name, topic in graph.topics.items()}
        self._recordings: list[RecorderThread] = []
        self._source_parameters = self.parameters[graph.source.name]
        self._source = self._open_source()
        self._source_stats = NodeStats()
        self._source_failed = False
        self._nodes = [self._join(node) for node in graph.nodes[1:]]
        self._threads = [threading.Thread(target=self._feed, name="source", daemon=True)]
        self._threads += [threading.Thread(target=node.run, daemon=True) for node in self._nodes]
        for name, parameters in self.parameters.items():
            parameters.on_change(partial(self._parameters_changed, name))

    def start(self) -> None:
        """Begin; the source is open already."""
        for thread in self._threads:
            thread.start()

    def wait(self, timeout_s: float) -> bool:
        """Wait for the end of the stream; True when everything has passed every node."""
        deadline_s = time.monotonic() + timeout_s
        alive = [thread for thread in self._threads if thread.is_alive()]
        for thread in alive:
            thread.join(max(deadline_s - time.monotonic(), 0))
        return not any(thread.is_alive() for thread in alive)

    def stop(self) -> None:
        """End now and close all recordings; what is still on its way to a node is let go."""
        self.playback.close()
        for node in self._nodes:
            node.inbox.close(discard=True)
        for recording in self._recordings:
            self.stop_recording(recording)
        self.wait(_STOP_TIMEOUT_S)
        self._source.close()

    @property
    def failed(self) -> bool:
        """Something was lost: the source broke, a node raised, a recording could not go on."""
        return (
            self._source_failed
            or any(node.runner.failed for node in self._nodes)
            or any(recording.error for recording in self._recordings)
        )

    def subscribe(self, topic: str) -> Subscription:
        """Look at a topic, beginning with its last message."""
        inbox = Inbox(lossless=False)
        self._topics[topic].connect(inbox, latched=True)
        return Subscription(inbox, partial(self._topics[topic].disconnect, inbox))

    def report(self, window_s: float | None = None) -> dict[str, Any]:
        """The run report; see `ros_visualise.runtime.base.Runtime`."""
        topics = {
            name: {"type": type_name(topic.type), **self._topics[name].report(window_s)}
            for name, topic in self.graph.topics.items()
            if self._topics[name].wanted
        }
        nodes = {self.graph.source.name: self._report_source()}
        nodes |= {thread.runner.node.name: thread.report() for thread in self._nodes}
        for node in self.graph.nodes:
            for topic in tuple(node.outputs.values())[:1]:
                nodes[node.name]["achieved_hz"] = self._topics[topic].report(window_s)["hz"]
        return {"topics": topics, "nodes": nodes, "recordings": self._recording_report()}

    def start_recording(self, target: str | Path, overwrite: bool = False) -> RecorderThread:
        """Record to a file from now on; a source that can wait then waits for the disk.

        Raises:
            OpenError: it exists or cannot be written.
            UsageError: it names a topic that there is not, or no known kind of file.
        """
        types = {name: topic.type for name, topic in self.graph.topics.items()}
        on_demand = [name for name, topic in self.graph.topics.items() if topic.on_demand]
        path = parse_target(str(target))[0].resolve()
        if any(one.is_open and one.path.resolve() == path for one in self._recordings):
            raise UsageError(f"{path}: is being recorded already; choose another name")
        recorder = open_recorder(str(target), types, overwrite, on_demand)
        recording = RecorderThread(recorder, self.graph, not self._source_type.live)
        for name, parameters in self.parameters.items():
            recording.put_event(ParameterEvent(name, new=vars(parameters.current)))
        self._recordings.append(recording)
        for topic, inbox in recording.inboxes.items():
            self._topics[topic].connect(inbox)
        return recording

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        recording.close()
        for topic, inbox in recording.inboxes.items():
            self._topics[topic].disconnect(inbox)

    def _feed(self) -> None:
        node = self.graph.source
        try:
            for number, (port, message) in enumerate(self._messages()):
                packet = Packet(number, message, time.monotonic_ns())
                self._source_stats.received = self._source_stats.processed = number + 1
                self._choose_queues()
                self._topics[node.outputs[port]].publish(packet)
        except RosVisualiseError as error:
            log.error("%s", error)
            self._source_failed = True
        except Exception:
            log.exception("%s broke", node.name)
            self._source_failed = True
        for topic in node.outputs.values():
            self._topics[topic].finish()

    def _messages(self) -> Iterator[tuple[str, Any]]:
        """What the source gives; when a parameter asks for it, it is opened anew."""
        while True:
            yield from self._source.messages()
            if not self.playback.take_restart():
                return
            self._reopen_source()

    def _reopen_source(self) -> None:
        """Open the source with its parameters of now, or return to those that it had."""
        if self._source_type.live:
            self._source.close()  # a device can be opened but once
        try:
            source = self._open_source()
        except RosVisualiseError as error:
            if self._opened_with == self._source_parameters.current:
                raise
            log.error("%s", error)
            self._source_parameters.update(vars(self._opened_with))
        else:
            self._source.close()
            self._source = source

    def _open_source(self) -> Source:
        current = self._source_parameters.current
        source = self._source_type.make(current, self.playback)
        self._opened_with = current
        return source

    def _join(self, node: Node) -> _NodeThread:
        [(port, topic)] = node.inputs.items()
        outputs = {name: self._topics[output] for name, output in node.outputs.items()}
        runner = NodeRunner(node, self.parameters[node.name])
        thread = _NodeThread(runner, port, outputs)
        self._topics[topic].connect(thread.inbox)
        return thread

    def _choose_queues(self) -> None:
        """Drop nothing where the source can wait and somebody wants everything."""
        wanted = self.playback.state.rate == 0 or any(one.is_open for one in self._recordings)
        lossless = wanted and not self._source_type.live
        if lossless != self._lossless:
            self._lossless = lossless
            for node in self._nodes:
                node.inbox.lossless = lossless

    def _parameters_changed(self, name: str, current: Any, changed: Mapping[str, Value]) -> None:
        for recording in self._recordings:
            recording.put_event(ParameterEvent(name, changed=changed))
        if name == self.graph.source.name:
            if any(spec.restart for spec in specs(current) if spec.name in changed):
                self.playback.restart()
        elif not self.playback.state.playing:
            for node in self._nodes:
                if node.runner.node.name == name:
                    node.repeat_last()

    def _report_source(self) -> dict[str, Any]:
        return {**self._source_stats.report(), **self._source.report()}

    def _recording_report(self) -> dict[str, Any]:
        return {
            str(r.path): {"messages": r.written, "dropped": r.dropped} for r in self._recordings
        }


class _NodeThread:
    """Takes one node's messages, runs its steps, publishes what comes out."""

    def __init__(self, runner: NodeRunner, port: str, outputs: Mapping[str, Topic]) -> None:
        self.runner = runner
        self.inbox = Inbox(lossless=False)
        self._port = port
        self._outputs = outputs

    def run(self) -> None:
        """Until the inbox is closed and empty."""
        number = arrival_ns = 0
        try:
            while (packet := self.inbox.take()) is not None:
                number, message, arrival_ns = packet
                answer = NOTHING
                if message is not None:
                    answer = self.runner.step({self._port: message}, arrival_ns)
                self._publish(number, answer, arrival_ns)
            self._publish(number, self.runner.finish(), arrival_ns)
        finally:
            self.inbox.close(discard=True)
            for topic in self._outputs.values():
                topic.finish()

    def repeat_last(self) -> None:
        """Process the last message once more, with the parameters as they are now."""
        if self.runner.stateless:
            self.inbox.repeat()

    def report(self) -> dict[str, Any]:
        """Counts, latencies and the node's own figures."""
        report = self.runner.report()
        if self.inbox.dropped:
            report["dropped"]["queue"] = self.inbox.dropped
        return report

    def _publish(self, number: int, answer: Mapping[str, Any], arrival_ns: int) -> None:
        for port, topic in self._outputs.items():
            topic.publish(Packet(number, answer.get(port), arrival_ns))
