"""The runtime with no ROS: every node is a thread of one process, images pass by reference."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ros_visualise.core import supervision
from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.core.message import Message
from ros_visualise.core.params import Parameters, Value, specs
from ros_visualise.data import ParameterEvent
from ros_visualise.graph import Graph, Member, Node
from ros_visualise.runtime.ingress import Ingress, Numbering
from ros_visualise.runtime.memory import manage_memory
from ros_visualise.runtime.node_inputs import node_inputs
from ros_visualise.runtime.node_thread import NodeThread
from ros_visualise.runtime.ordering import origins
from ros_visualise.runtime.queues import Inbox
from ros_visualise.runtime.recording import RecorderThread, Recordings
from ros_visualise.runtime.report import NodeReport, OutputReport, RunReport, TopicReport
from ros_visualise.runtime.runner import NodeRunner
from ros_visualise.runtime.source_thread import SourceInput, SourceThread
from ros_visualise.runtime.topics import Subscription, Topic
from ros_visualise.sinks.parts import Split
from ros_visualise.sources.playback import Playback

_STOP_TIMEOUT_S = 1.0
_PATIENCE_S = 10.0  # of a source with answers, where messages may be dropped
_IDLE_S = 0.5  # without a message, an input is at a standstill


class LocalRuntime:
    """Runs a graph in this process; see `ros_visualise.runtime.base.Runtime`.

    Args:
        graph: what to run.
        playback: how its source is played; None for a graph without a source, whose messages come
            by `publish`. Unthrottled (rate 0), and while it is recorded, busy nodes drop nothing:
            the source waits instead, unless it is live.

    Raises:
        OpenError: the source cannot be opened.
    """

    name = ""
    diagnostic_topics: Mapping[str, type[Message]] = {}

    def __init__(self, graph: Graph, playback: Playback | None) -> None:
        self.graph = graph
        self.playback = playback
        self.parameters: Mapping[str, Parameters[Any]] = {
            node.name: Parameters(node.params) for node in graph.members
        }
        self._lossless = False
        self._topics = {name: Topic(name) for name in graph.inputs}
        self._topics |= {name: Topic(name, topic.on_demand) for name, topic in graph.topics.items()}
        numbering = Numbering()
        self._ingresses = {
            name: Ingress(name, self._topics[name], numbering) for name in graph.inputs
        }
        self._recordings = Recordings(self._connect, self._disconnect)
        self._source_inputs: list[SourceInput] = []
        self._source = self._open_source()
        self._nodes = self._make_nodes()
        self._works = {self._source.name: self._source.run} if self._source else {}
        self._works |= {name: node.run for name, node in self._nodes.items()}
        self._running = 0
        self._ended = threading.Condition()  # joining a thread does not outlive a Ctrl-C
        self._broken = False
        for name, parameters in self.parameters.items():
            parameters.on_change(partial(self._parameters_changed, name))

    def start(self) -> None:
        """Begin; the source is open already."""
        manage_memory()
        self._running = len(self._works)
        for name, work in self._works.items():
            supervision.start(name, partial(self._run, name, work))

    def wait(self, timeout_s: float) -> bool:
        """Wait for the end of the stream; True when everything has passed every node."""
        with self._ended:
            return self._ended.wait_for(lambda: self._running == 0, timeout_s)

    def stop(self) -> None:
        """End now and close all recordings; messages on their way to a node are discarded."""
        if self.playback is not None:
            self.playback.close()
        for node in self._nodes.values():
            node.inbox.close(discard=True)
        self._recordings.end()
        self.wait(_STOP_TIMEOUT_S)
        if self._source is not None:
            self._source.close()

    def report_lost(self) -> None:
        """Warn of unreadable parts of the source, of each once."""
        if self._source is not None:
            self._source.report_lost()

    @property
    def steps(self) -> int | None:
        """Messages that recordings have handled so far; None while no recording has work left."""
        recordings = [one for one in self._recordings if not one.has_ended]
        if not recordings or any(recording.closing for recording in recordings):
            return None
        return sum(recording.written + recording.dropped for recording in recordings)

    @property
    def failed(self) -> bool:
        """True if the source, a node or a recording failed."""
        return (
            self._broken
            or bool(self.errors)
            or any(recording.error for recording in self._recordings)
        )

    @property
    def errors(self) -> dict[str, BaseException]:
        """Node or source -> its first error."""
        found = {name: node.runner.error for name, node in self._nodes.items()}
        if self._source is not None:
            found[self._source.name] = self._source.error
        return {name: error for name, error in found.items() if error is not None}

    def topic(self, name: str) -> Topic:
        """A topic of the graph or an input of it, to listen to; raises UsageError."""
        if name not in self._topics:
            raise UsageError(f"no topic {name!r}{did_you_mean(name, self._topics)}")
        return self._topics[name]

    def wait_until_taken(self, topic: str, timeout_s: float) -> None:
        """Wait until the nodes that listen to a topic have begun with its last message."""
        for node in self._nodes.values():
            if any(topic == taken for taken, _ in node.listeners):
                node.inbox.wait_until_taken(timeout_s)

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic, beginning with its last message."""
        inbox, found = Inbox(lossless=False, keep=depth), self.topic(topic)
        found.connect(inbox, latched=True)
        return Subscription(topic, inbox, partial(found.disconnect, inbox))

    def publish(self, topic: str, message: Any) -> None:
        """Publish on a topic that comes from outside, or where the source comes from."""
        if topic in self._ingresses:
            self._ingresses[topic].publish(message)
        elif self._source is not None:
            self._source.publish(topic, message)

    @property
    def publishes(self) -> bool:
        """True if the source publishes further topics."""
        return self.graph.source is not None and self.graph.source.type.publishes

    def act(self, node: str, action: str) -> None:
        """Run an action of a node."""
        if self._source is not None and node == self._source.name:
            self._source.act(action)
        else:
            self._nodes[node].act(action)

    def report(self, window_s: float | None = None) -> RunReport:
        """The run report; see `ros_visualise.runtime.base.Runtime`."""
        topics = {
            name: self._topics[name].report(topic.ros.name, window_s)
            for name, topic in self.graph.topics.items()
        }
        nodes = {member.name: self._node_report(member, topics) for member in self.graph.members}
        wanted = {name: topic for name, topic in topics.items() if self._topics[name].reported}
        return RunReport(wanted, nodes, self._recordings.report())

    def _node_report(self, member: Member, topics: Mapping[str, TopicReport]) -> NodeReport:
        if self._source is not None and member is self.graph.source:
            report = self._source.report()
        else:
            report = self._nodes[member.name].report()
        made = {topic: topics[topic] for topic in member.outputs.values()}
        outputs = {topic: OutputReport(one.hz, one.wall_hz) for topic, one in made.items()}
        return replace(report, inputs=member.inputs, outputs=outputs)

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> RecorderThread:
        """Record to a file from now on; a source that can wait then waits for the disk."""
        lossless, graph = not self.graph.live, self.graph
        return self._recordings.start(
            graph, self.parameters, path, overwrite, topics, split, lossless
        )

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        self._recordings.stop(recording)

    def _connect(self, recording: RecorderThread) -> None:
        for topic, listener in recording.listeners.items():
            self._topics[topic].connect(listener)

    def _disconnect(self, recording: RecorderThread) -> None:
        for topic, listener in recording.listeners.items():
            self._topics[topic].disconnect(listener)

    def _open_source(self) -> SourceThread | None:
        node = self.graph.source
        if node is None or self.playback is None:
            return None
        outputs = {port: self._topics[topic] for port, topic in node.outputs.items()}
        parameters = self.parameters[node.name]
        source = SourceThread(
            node, parameters, self.playback, outputs, self._choose_queues, self._await_answers
        )
        for port, topic in node.inputs.items():
            listener = SourceInput(source, port, origins(self.graph, topic))
            self._source_inputs.append(listener)
            self._topics[topic].connect(listener)
        return source

    def _await_answers(self, number: int, topic: str) -> None:
        """Wait for the nodes' answers to a message of the source, if it needs them.

        So a robot that is controlled by nodes flies the same way each time, however fast they are.
        """
        patience_s = math.inf if self._lossless else _PATIENCE_S
        for one in self._source_inputs:
            one.wait_for(number, topic, self._goes_on, patience_s)

    def _goes_on(self) -> bool:
        return self.playback is not None and not self.playback.closed

    def _run(self, name: str, work: Callable[[], None]) -> None:
        """Run a member; its failure is counted before its end is known."""
        try:
            if not supervision.attempt(name, work, BaseException):
                self._broken = True
        finally:
            if self._source is not None and name == self._source.name:
                self._end_live_nodes()
            with self._ended:
                self._running -= 1
                self._ended.notify_all()

    def _end_live_nodes(self) -> None:
        """End the nodes that nothing else ends, as they take what is made of their own messages."""
        for node in self._nodes.values():
            if node.runner.node.type.live:
                node.inbox.close()

    def _make_nodes(self) -> dict[str, NodeThread]:
        """The nodes; if one cannot be made, the source is closed again."""
        try:
            return {node.name: self._make_node(node) for node in self.graph.nodes}
        except BaseException:
            if self._source is not None:
                self._source.close()
            raise

    def _make_node(self, node: Node) -> NodeThread:
        outputs = {name: self._topics[output] for name, output in node.outputs.items()}
        runner = NodeRunner(node, self.parameters[node.name])
        inputs = node_inputs(self.graph, runner)
        thread = NodeThread(runner, inputs, outputs, ticks=self.graph.source is None)
        for topic, listener in thread.listeners:
            self._topics[topic].connect(listener)
        return thread

    def _choose_queues(self) -> None:
        """Drop nothing where the source can wait, and is unthrottled or recorded."""
        wanted = self._is_unthrottled() or any(one.is_open for one in self._recordings)
        lossless = wanted and not self.graph.live
        if lossless != self._lossless:
            self._lossless = lossless
            for node in self._nodes.values():
                node.inbox.lossless = lossless

    def _parameters_changed(self, name: str, current: Any, changed: Mapping[str, Value]) -> None:
        self._recordings.put_event(ParameterEvent(name, changed=changed))
        if self._source is not None and name == self._source.name:
            if any(spec.restart for spec in specs(current) if spec.name in changed):
                assert self.playback is not None
                self.playback.restart()
        elif self._is_idle():
            self._nodes[name].repeat_last()

    def _is_unthrottled(self) -> bool:
        return self.playback is not None and self.playback.state.rate == 0

    def _is_idle(self) -> bool:
        """True if no message comes that would show the effect of new parameters."""
        if self.playback is not None:
            return not self.playback.state.playing
        return all(self._topics[name].idle_s > _IDLE_S for name in self.graph.inputs)
