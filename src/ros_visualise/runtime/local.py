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
from ros_visualise.core.errors import UsageError
from ros_visualise.core.params import Parameters, Value, specs
from ros_visualise.data import ParameterEvent
from ros_visualise.graph import Graph, Member, Node
from ros_visualise.runtime.entrance import Entrance, Numbering
from ros_visualise.runtime.joining import joining_of
from ros_visualise.runtime.memory import tend_memory
from ros_visualise.runtime.node_thread import NodeThread
from ros_visualise.runtime.ordering import origins
from ros_visualise.runtime.queues import Inbox
from ros_visualise.runtime.recording import RecorderThread, record, report_recordings
from ros_visualise.runtime.report import NodeReport, RunReport
from ros_visualise.runtime.runner import NodeRunner
from ros_visualise.runtime.source_input import SourceInput
from ros_visualise.runtime.source_thread import SourceThread
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
        playback: how its source is played; None for a graph without a source, whose inputs
            somebody feeds (see `publish`). At rate 0, and while it is recorded, no node drops what
            it has no time for: the source waits instead, unless it is live.

    Raises:
        OpenError: the source cannot be opened.
    """

    name = ""
    told: Mapping[str, type] = {}

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
        self._entrances = {
            name: Entrance(name, self._topics[name], numbering) for name in graph.inputs
        }
        self._recordings: list[RecorderThread] = []
        self._recording = threading.Lock()
        self._stopped = False
        self._source_inputs: list[SourceInput] = []
        self._source = self._open_source()
        self._nodes = self._join_all()
        self._works = {self._source.name: self._source.run} if self._source else {}
        self._works |= {name: node.run for name, node in self._nodes.items()}
        self._running = 0
        self._ended = threading.Condition()  # joining a thread does not outlive a Ctrl-C
        self._broken = False
        for name, parameters in self.parameters.items():
            parameters.on_change(partial(self._parameters_changed, name))

    def start(self) -> None:
        """Begin; the source is open already."""
        tend_memory()
        self._running = len(self._works)
        for name, work in self._works.items():
            supervision.start(name, partial(self._run, name, work))

    def wait(self, timeout_s: float) -> bool:
        """Wait for the end of the stream; True when everything has passed every node."""
        with self._ended:
            return self._ended.wait_for(lambda: self._running == 0, timeout_s)

    def stop(self) -> None:
        """End now and close all recordings; what is still on its way to a node is let go."""
        if self.playback is not None:
            self.playback.close()
        for node in self._nodes.values():
            node.inbox.close(discard=True)
        with self._recording:
            self._stopped = True
        for recording in self._recordings:
            self.stop_recording(recording)
        self.wait(_STOP_TIMEOUT_S)
        if self._source is not None:
            self._source.close()

    def report_lost(self) -> None:
        """Warn of what the source could not read so far, of each thing once."""
        if self._source is not None:
            self._source.report_lost()

    @property
    def steps(self) -> int | None:
        """How many messages recordings have worked on by now; None while none has work left."""
        recordings = [recording for recording in self._recordings if not recording.has_ended]
        if not recordings or any(recording.closing for recording in recordings):
            return None
        return sum(recording.written + recording.dropped for recording in recordings)

    @property
    def failed(self) -> bool:
        """Something was lost: the source broke, a node raised, a recording could not go on."""
        return (
            self._broken
            or (self._source is not None and self._source.failed)
            or any(node.runner.failed for node in self._nodes.values())
            or any(recording.error for recording in self._recordings)
        )

    def topic(self, name: str) -> Topic:
        """A topic of the graph or an input of it, to listen to."""
        return self._topics[name]

    def wait_until_taken(self, topic: str, timeout_s: float) -> None:
        """Wait until the nodes that listen to a topic have begun with its last message."""
        for node in self._nodes.values():
            if any(topic == taken for taken, _ in node.inputs):
                node.inbox.wait_until_taken(timeout_s)

    def subscribe(self, topic: str, depth: int = 1) -> Subscription:
        """Look at a topic, beginning with its last message."""
        inbox = Inbox(lossless=False, keep=depth)
        self._topics[topic].connect(inbox, latched=True)
        return Subscription(topic, inbox, partial(self._topics[topic].disconnect, inbox))

    def publish(self, topic: str, message: Any) -> None:
        """Publish on a topic that comes from outside."""
        self._entrances[topic].publish(message)

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
            if self._topics[name].wanted
        }
        nodes = {member.name: self._node_report(member, window_s) for member in self.graph.members}
        return RunReport(topics, nodes, report_recordings(self._recordings))

    def _node_report(self, member: Member, window_s: float | None) -> NodeReport:
        if self._source is not None and member is self.graph.source:
            report = self._source.report()
        else:
            report = self._nodes[member.name].report()
        main = next(iter(member.topics.items()), None)
        if main is None:
            return report
        hz = self._topics[main[0]].report(main[1].ros.name, window_s).hz
        return replace(report, publishes=True, achieved_hz=hz)

    def start_recording(
        self,
        path: str | Path,
        overwrite: bool = False,
        topics: Collection[str] = (),
        split: Split | None = None,
    ) -> RecorderThread:
        """Record to a file from now on; a source that can wait then waits for the disk.

        Args:
            path, overwrite, topics: as of `ros_visualise.runtime.base.Runtime`.
            split: when another file begins.

        Raises:
            OpenError: it exists or cannot be written.
            UsageError: it names a topic that there is not, or no known kind of file; or the run
                has ended.
        """
        lossless = not self.graph.live
        with self._recording:
            if self._stopped:
                raise UsageError(f"{path}: the run has ended, so there is nothing to record")
            recording = record(
                self.graph, self.parameters, path, topics, overwrite, lossless, split=split
            )
            self._recordings.append(recording)
        for topic, inbox in recording.inboxes.items():
            self._topics[topic].connect(inbox)
        return recording

    def stop_recording(self, recording: RecorderThread) -> None:
        """End and close a recording; more than once does no harm."""
        recording.close()
        for topic, inbox in recording.inboxes.items():
            self._topics[topic].disconnect(inbox)

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
            entrance = SourceInput(source, port, origins(self.graph, topic))
            self._source_inputs.append(entrance)
            self._topics[topic].connect(entrance)
        return source

    def _await_answers(self, number: int, topic: str) -> None:
        """Let the source hear what is made of its message first, if it needs to.

        So a robot that sees by the nodes' eyes flies the same way each time, however fast they are.
        """
        patience_s = math.inf if self._lossless else _PATIENCE_S
        for entrance in self._source_inputs:
            entrance.wait_for(number, topic, self._goes_on, patience_s)

    def _goes_on(self) -> bool:
        return self.playback is not None and not self.playback.closed

    def _run(self, name: str, work: Callable[[], None]) -> None:
        """Run a member; whoever hears of its end finds its failure counted."""
        try:
            if not supervision.attempt(name, work, BaseException):
                self._broken = True
        finally:
            with self._ended:
                self._running -= 1
                self._ended.notify_all()

    def _join_all(self) -> dict[str, NodeThread]:
        """The nodes; where one cannot be made, the source is closed again."""
        try:
            return {node.name: self._join(node) for node in self.graph.nodes}
        except BaseException:
            if self._source is not None:
                self._source.close()
            raise

    def _join(self, node: Node) -> NodeThread:
        outputs = {name: self._topics[output] for name, output in node.outputs.items()}
        runner = NodeRunner(node, self.parameters[node.name])
        joining = joining_of(self.graph, runner)
        thread = NodeThread(runner, joining, outputs, ticks=self.graph.source is None)
        for topic, entrance in thread.inputs:
            self._topics[topic].connect(entrance)
        return thread

    def _choose_queues(self) -> None:
        """Drop nothing where the source can wait and somebody wants everything."""
        wanted = self._in_haste() or any(one.is_open for one in self._recordings)
        lossless = wanted and not self.graph.live
        if lossless != self._lossless:
            self._lossless = lossless
            for node in self._nodes.values():
                node.inbox.lossless = lossless

    def _parameters_changed(self, name: str, current: Any, changed: Mapping[str, Value]) -> None:
        for recording in self._recordings:
            recording.put_event(ParameterEvent(name, changed=changed))
        if self._source is not None and name == self._source.name:
            if any(spec.restart for spec in specs(current) if spec.name in changed):
                assert self.playback is not None
                self.playback.restart()
        elif self._is_idle():
            self._nodes[name].repeat_last()

    def _in_haste(self) -> bool:
        return self.playback is not None and self.playback.state.rate == 0

    def _is_idle(self) -> bool:
        """Nothing comes that would show what new parameters do."""
        if self.playback is not None:
            return not self.playback.state.playing
        return all(self._topics[name].idle_s > _IDLE_S for name in self.graph.inputs)
