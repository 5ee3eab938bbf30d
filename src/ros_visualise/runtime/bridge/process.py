"""A graph of nodes in this process, connected to the topics of a transport's graph."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.params import Parameters
from ros_visualise.data import Image, Transforms
from ros_visualise.graph import Graph, M, Member
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.bridge.inputs import ImageInput, Input
from ros_visualise.runtime.bridge.outputs import (
    ImageOutput,
    Output,
    StaticFrames,
    StaticTransformsOutput,
)
from ros_visualise.runtime.bridge.services import offer_actions, offer_calibration
from ros_visualise.runtime.diagnostics import DiagnosticsPublisher
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.middleware import Handle, Transport
from ros_visualise.runtime.playing import PlaybackFollower
from ros_visualise.runtime.report import NodeReport
from ros_visualise.sources.playback import Playback
from ros_visualise.vision.compression import JPEG_QUALITY

log = logging.getLogger(__name__)

_DIAGNOSTICS_S = 1.0
_FLUSH_S = 0.5
_PATIENCE_S = 1.0
_STALL_S = 0.1  # for all subscribers together may block a node for so long


class Process:
    """Runs a graph and connects it to a transport: topics, parameters, services, diagnostics.

    Messages pass between its nodes by reference, and are published only on topics with subscribers.
    While it is inactive, it does not accept messages, publishes none, and its source is suspended.

    Args:
        transport: of the graph around it.
        graph: what to run; its topics are relative to the namespace and may be remapped.
        playback: how its source is played; None without a source.
        namespaces: node name -> namespace of its parameters below this node's private one.
        compressed: subscribe to compressed images.
        jpeg_quality: of published compressed images, percent.

    Raises:
        OpenError: the source cannot be opened.
        UsageError: a node's output is remapped to its own input.
    """

    def __init__(
        self,
        transport: Transport,
        graph: Graph,
        playback: Playback | None,
        namespaces: Mapping[str, str],
        compressed: bool = False,
        jpeg_quality: int = JPEG_QUALITY,
    ) -> None:
        self._jpeg_quality = jpeg_quality
        self._transport = transport
        self._namespaces = namespaces
        names = [_outside(name) for name in (*graph.inputs, *graph.topics)]
        self._declared = {transport.resolve(name): name for name in names}
        self.runtime = LocalRuntime(_resolved(graph, transport), playback)
        self._graph = self.runtime.graph
        self._frames = StaticFrames()
        self._outputs = {name: self._open_output(name) for name in self._graph.topics}
        self._is_active = False
        self._player: PlaybackFollower | None = None
        self._is_at_end = False
        if playback is not None and self._graph.source is not None:
            playback.suspend(True)
            parameters = self.runtime.parameters[self._graph.source.name]
            self._player = PlaybackFollower(playback, parameters)
        self._diagnostics = DiagnosticsPublisher(transport)
        self._diagnosed_s = time.monotonic()
        self._compressed = compressed
        self._inputs = {name: self._input(name, kind) for name, kind in self._graph.inputs.items()}
        self._offered: list[Handle] = []

    def start(self, active: bool = True) -> None:
        """Run; it is at work before its parameters can be found.

        Args:
            active: take and publish messages at once, not only after `activate`.
        """
        if active:
            self.activate()
        self.runtime.start()
        self._offered = [
            self._transport.serve_parameters(parameters, self._namespaces[name])
            for name, parameters in self.runtime.parameters.items()
        ]
        self._offered += offer_actions(self._transport, self.runtime, self._namespaces)
        self._offered += offer_calibration(self._transport, self.runtime)

    def activate(self) -> None:
        """Take and publish messages from now on."""
        for name, output in self._outputs.items():
            wants = partial(getattr, output, "awaited")
            self.runtime.topic(name).connect(output, output.latched, wants)
        for one in self._inputs.values():
            one.open()
        self._is_active = True
        self._suspend(False)

    def deactivate(self) -> None:
        """Take and publish none until the next `activate`; the nodes keep their state."""
        self._suspend(True)
        self._is_active = False
        for one in self._inputs.values():
            one.close()
        for name, output in self._outputs.items():
            self.runtime.topic(name).disconnect(output)

    def _suspend(self, suspended: bool) -> None:
        if self.runtime.playback is not None:
            self.runtime.playback.suspend(suspended)

    def follow(self) -> None:
        """Do periodic work; to be called some ten times a second."""
        if self._player is not None:
            self._player.follow()
        self._notice_end()
        if self._is_active:
            self._follow_calibrations()
        if time.monotonic() - self._diagnosed_s >= _DIAGNOSTICS_S:
            self._diagnosed_s = time.monotonic()
            self._diagnostics.publish(self._reports())

    def _follow_calibrations(self) -> None:
        """Subscribe to calibrations while those of images made here have subscribers."""
        outputs = [one for one in self._outputs.values() if isinstance(one, ImageOutput)]
        for one in self._inputs.values():
            if isinstance(one, ImageInput):
                one.want_info(any(output.wants_info for output in outputs))

    def unconnected(self) -> list[str]:
        """Topics of this process whose subscribers on the graph have not all connected.

        Empty unless the source is unthrottled: it could end before they connect.
        """
        if not self._is_unthrottled():
            return []
        there = {topic: len(set(nodes)) for topic, nodes in self._transport.listing().subscribers}
        publishers = [one for output in self._outputs.values() for one in output.publishers]
        return [one.name for one in publishers if one.connections < there.get(one.name, 0)]

    def subscribers(self, name: str) -> int:
        """Number of subscribers to a topic of this process, named in its node's words.

        Raises:
            UsageError: unknown topic.
        """
        for topic, output in self._outputs.items():
            if self._declared[topic] == _outside(name):
                return output.connections
        raise UsageError(f"no such topic: {name}; choose from {', '.join(self._declared.values())}")

    @property
    def parameters(self) -> dict[str, Parameters[Any]]:
        """The live parameters of its nodes, by the names of launch files and ``params:=``."""
        own = self._transport.resolve("~").rpartition("/")[2]
        there = self.runtime.parameters.items()
        return {self._namespaces[name] or own: parameters for name, parameters in there}

    @property
    def failed(self) -> bool:
        """True if messages were lost, by its nodes or on the way to the graph."""
        runtime = self.runtime
        is_refused = any(output.refused for output in self._outputs.values())
        return runtime.failed or runtime.report().is_incomplete or is_refused

    def stop(self) -> None:
        """End now, and close all services; the last messages are still sent."""
        for one in (*self._offered, *self._inputs.values()):
            one.close()
        self.runtime.stop()
        for output in self._outputs.values():
            output.flush(_FLUSH_S / len(self._outputs))

    def leave(self) -> None:
        """Close the topics too, after `stop`, while this node of the graph goes on."""
        for output in self._outputs.values():
            output.leave()
        self._diagnostics.close()

    def _open_output(self, name: str) -> Output:
        topic, source, declared = self._graph.topics[name], self._graph.source, self._declared[name]
        is_recorded = source is not None and declared in map(_outside, source.type.ros)
        if is_recorded:  # played under its own name, and not as a camera's
            is_static = topic.ros.data_class is Transforms and name.endswith("tf_static")
            made = replace(topic.ros, qos=LATCHED) if is_static else topic.ros
        elif topic.type is Image:
            is_camera = source is not None and name in source.outputs.values()
            unthrottled, quality = self._is_unthrottled, self._jpeg_quality
            return ImageOutput(self._transport, declared, name, is_camera, unthrottled, quality)
        else:
            made = TopicType(topic.type.type_name, qos=topic.ros.qos)
            is_static = topic.type is Transforms and made.qos.transient_local
            declared = _with_others(declared, topic.type)
        publisher = self._transport.advertise(declared, made)
        if is_static:
            return StaticTransformsOutput(publisher, self._frames)
        return Output(publisher, made.qos.transient_local, self._is_unthrottled)

    def _is_unthrottled(self) -> bool:
        """True if the source plays as fast as possible: then it waits for subscribers."""
        playback = self.runtime.playback
        return playback is not None and playback.state.rate == 0

    def _input(self, name: str, kind: type) -> Input:
        declared, feed = self._declared[name], partial(self.runtime.publish, name)
        if kind is Image:
            wait = partial(self._wait_for_room, name)
            takers = [one for one in self._graph.nodes if name in one.inputs.values()]
            calibrated = any(node.type.calibrated for node in takers)
            return ImageInput(
                self._transport, declared, name, feed, self._compressed, wait, calibrated
            )
        return Input(self._transport, declared, kind, feed)

    def _wait_for_room(self, name: str) -> None:
        """Wait until the nodes have taken the last image and could publish their output."""
        self.runtime.wait_until_taken(name, _PATIENCE_S)
        end_s = time.monotonic() + _STALL_S
        for output in self._outputs.values():
            output.wait_for_room(end_s - time.monotonic())

    def _notice_end(self) -> None:
        """Log each time that the source reaches its end, and waits there."""
        playback, source = self.runtime.playback, self._graph.source
        if playback is None or source is None:
            return
        was_at_end, self._is_at_end = self._is_at_end, playback.holds and playback.state.ended
        if self._is_at_end and not was_at_end:
            self.runtime.report_lost()
            what = "%s ended; to play it again, set its parameter paused to false"
            log.info(what, source.name)

    def _reports(self) -> dict[str, NodeReport]:
        """The report of every node, by its full name on the graph."""
        nodes = self.runtime.report(_DIAGNOSTICS_S).nodes
        own = self._transport.resolve("~")
        return {
            f"{own}/{self._namespaces[node.name]}".rstrip("/"): self._report(node, nodes[node.name])
            for node in self._graph.members
        }

    def _report(self, node: Member, report: NodeReport) -> NodeReport:
        """A node's report, with messages dropped on the way to it and to its subscribers."""
        inputs = [one for name, one in self._inputs.items() if name in node.inputs.values()]
        skipped, refused = sum(one.dropped for one in inputs), sum(one.refused for one in inputs)
        dropped = Counter(report.dropped) + Counter(queue=skipped, damaged=refused)
        ended = {"ended": self._is_at_end} if node is self._graph.source else {}
        return replace(
            report,
            received=report.received + skipped + refused,
            dropped=dict(dropped),
            own={**report.own, **ended},
            outputs={
                topic: replace(output, dropped=self._outputs[topic].dropped)
                for topic, output in report.outputs.items()
            },
        )


def _outside(topic: str) -> str:
    """A topic's name for the transport: relative to the namespace, for several robots.

    ``/tf`` is not: all robots share one tree of frames.
    """
    name = topic.removeprefix("/")
    return f"/{name}" if name in ("tf", "tf_static") else name


def _with_others(topic: str, kind: type) -> str:
    """The topic for a node's frames: ``/tf`` itself, also if its own name for it is longer."""
    name = topic.rpartition("/")[2]
    return f"/{name}" if kind is Transforms and name in ("tf", "tf_static") else topic


def _resolved(graph: Graph, transport: Transport) -> Graph:
    """The graph with the full names of its topics."""

    def resolve(topics: Mapping[str, str]) -> dict[str, str]:
        return {port: transport.resolve(_outside(name)) for port, name in topics.items()}

    def on_resolved(member: M) -> M:
        return replace(member, inputs=resolve(member.inputs), outputs=resolve(member.outputs))

    resolved = graph.changed(on_resolved)
    for node in resolved.members:
        if taken := set(node.inputs.values()) & set(node.outputs.values()):
            raise UsageError(
                f"{node.name}: {taken.pop()} is both its input and its output; remap one"
            )
    return resolved
