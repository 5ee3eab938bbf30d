"""The inputs of a node: their messages are synchronized, and wait for the transforms of their time.

This works behind the node's inbox, on its thread: a node that waited for one input without taking
the others would block a source that both are made from.
"""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple, Protocol

from ros_visualise.core.declarations import TRANSFORMS
from ros_visualise.core.errors import DamagedMessage
from ros_visualise.core.synchronizer import EACH, synchronizer
from ros_visualise.data import Message
from ros_visualise.geometry.frames import WrongTransforms
from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.ordering import Ordering
from ros_visualise.runtime.queues import END, FINISHED, Inbox, Packet
from ros_visualise.runtime.runner import NodeRunner

log = logging.getLogger(__name__)

FRAMES_WAIT_S = 0.5
"""Longest time that a message waits for its transforms."""

_KEPT = 10  # images of an input in the inbox, as it is seen later which of them is matched
_UNMATCHED = 20  # messages of an input without any match, after which a warning is due
_MOST_HELD = 30
_MOST_WARNINGS = 10
_MOST_AT_ONCE = 1000
_LOOK_S = 0.05


class NodeStep(NamedTuple):
    """One step of a node: the packets to process, and the packet whose number the answer gets.

    Without packets the node has no answer for that number.
    """

    answers: Packet
    packets: tuple[Packet, ...]


class NodeInputs(Protocol):
    """Makes steps of the packets in a node's inbox.

    Attributes:
        origins: topics beside the node's inputs whose numbers it needs.
    """

    origins: tuple[str, ...]

    @property
    def dropped(self) -> Counter[str]:
        """Messages that are in no step, by reason and input."""

    def keep(self, kind: type[Message]) -> int:
        """Number of messages of an input that may wait in the inbox."""

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterable[NodeStep]:
        """The steps that are due; each is to be done before the next is asked for."""

    def finish(self) -> Iterable[NodeStep]:
        """The remaining steps, when all inputs have ended."""


def node_inputs(graph: Graph, runner: NodeRunner) -> NodeInputs:
    """The inputs of a node, as it declares them."""
    if runner.node.type.sync == EACH and not runner.node.type.frames:
        return _SingleInputs(runner)
    return _SynchronizedInputs(graph, runner)


class _SingleInputs:
    """Every message is a step by itself."""

    def __init__(self, runner: NodeRunner) -> None:
        self.origins: tuple[str, ...] = ()
        self.dropped: Counter[str] = Counter()
        self._counter = runner.counter

    def keep(self, kind: type[Message]) -> int:
        return kind.waiting

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterable[NodeStep]:
        packet = inbox.take(timeout_s)
        if packet is None or packet.number == FINISHED:
            return ()
        if packet.message is None:
            return (NodeStep(packet, ()),)
        self._counter.received += 1
        return (NodeStep(packet, (packet,)),)

    def finish(self) -> Iterable[NodeStep]:
        return ()


class _HeldSet(NamedTuple):
    """A set of messages that waits for its transforms."""

    since: Packet
    stamp_ns: int
    packets: tuple[Packet, ...]


class _SynchronizedInputs:
    """Sets of messages of several inputs, each with the frames that were known then.

    Where nothing is dropped, packets are taken in the order of their source numbers, so that the
    same input makes the same sets, and shows the node the same frames, however the threads run.
    Live, they are taken as they arrive, and of sets with images only the newest.
    """

    def __init__(self, graph: Graph, runner: NodeRunner) -> None:
        node = runner.node
        self._runner = runner
        self._counter = runner.counter
        self._type = node.type
        self._topics = dict(node.inputs)
        self._order = Ordering(graph, tuple(dict.fromkeys(node.inputs.values())), apart=True)
        self.origins = tuple(t for t in self._order.inputs if t not in node.inputs.values())
        self._synchronizer = synchronizer(
            node.type.sync, [port for port in node.inputs if port in node.type.stepped]
        )
        self._large = {port for port, kind in node.type.stepped.items() if kind.waiting == 1}
        self._lost: Counter[str] = Counter()
        self._held: deque[_HeldSet] = deque()
        self._last = Packet(0, None, 0)
        self._last_set: tuple[Packet, ...] = ()
        self._answered = self._epoch = 0
        self._newest_ns: dict[str, int] = {}
        self._came: Counter[str] | None = Counter()  # until the first match, or the warning
        self._warnings: set[str] = set()
        self._ending: set[str] = set()  # inputs on which nothing more comes

    @property
    def dropped(self) -> Counter[str]:
        unmatched = self._synchronizer.dropped.copy().items()
        return self._lost + Counter({f"{why} {port}": n for (port, why), n in unmatched})

    def keep(self, kind: type[Message]) -> int:
        return max(kind.waiting, _KEPT)

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterator[NodeStep]:
        packet = inbox.take(_LOOK_S if self._held else timeout_s)
        if not inbox.lossless:
            yield from self._take_newest(packet, inbox)
        elif packet is not None:
            yield from self._put(packet, at_once=False)

    def finish(self) -> Iterator[NodeStep]:
        for topic in self._order.inputs:
            self._order.finish(topic)
        yield from self._take_ordered(at_once=False)
        self._hold(self._synchronizer.finish())
        for held in self._held:
            yield self._step(self._last._replace(number=END), held.packets)

    def _take_newest(self, packet: Packet | None, inbox: Inbox) -> list[NodeStep]:
        """Take all packets that wait; of several sets with images only the newest is a step."""
        steps: list[NodeStep] = []
        for _ in range(_MOST_AT_ONCE):
            if packet is None:
                break
            steps += self._put(packet, at_once=True)
            packet = inbox.take(0)
        steps += self._release(at_once=True)
        large = [step for step in steps if any(one.port in self._large for one in step.packets)]
        for step in large[:-1]:
            self._lost["queue"] += len(step.packets)
            steps.remove(step)
        return steps

    def _put(self, packet: Packet, at_once: bool) -> Iterator[NodeStep]:
        if packet.again:
            yield NodeStep(packet, self._last_set)
            return
        if packet.message is not None:
            self._counter.received += 1
        self._order.put(self._topics.get(packet.port, packet.port), packet)
        yield from self._take_ordered(at_once)
        if packet.number == FINISHED and packet.port in self._type.stepped:
            self._ending.add(packet.port)
        self._end_inputs()
        if self._order.answered > self._answered:
            self._answered = self._order.answered
            yield NodeStep(packet._replace(number=self._answered, message=None, more=False), ())

    def _take_ordered(self, at_once: bool) -> Iterator[NodeStep]:
        while (topic := self._order.first(at_once)) is not None:
            self._last = packet = self._order.take(topic)
            self._synchronize(packet)
            yield from self._release(at_once)

    def _end_inputs(self) -> None:
        """End inputs of the synchronizer, once it has all of their messages."""
        for port in [p for p in self._ending if not self._order.waits(self._topics[p])]:
            self._ending.remove(port)
            self._synchronizer.end(port)

    def _synchronize(self, packet: Packet) -> None:
        """Give a packet to the frame tree or to the synchronizer."""
        port, message = packet.port, packet.message
        assert message is not None
        if packet.epoch < self._epoch:
            self._lost[f"stale {port}"] += 1
            return
        stamp_ns = message.header.stamp_ns
        self._reset_if_time_jumped(packet, stamp_ns)
        if self._type.frames and port in TRANSFORMS:
            self._add_frames(packet)
        if port in self._type.stepped:
            self._hold(self._synchronizer.put(port, stamp_ns, packet, message.nbytes))
            self._warn_if_unmatched(port)

    def _add_frames(self, packet: Packet) -> None:
        try:
            self._runner.frames.add(content(packet.message), packet.port == "tf_static")
        except (DamagedMessage, WrongTransforms) as error:
            self._lost[f"wrong {packet.port}"] += 1
            self._warn(f"{self._topics[packet.port]}: {error}")

    def _reset_if_time_jumped(self, packet: Packet, stamp_ns: int) -> None:
        """Drop waiting messages, and forget moving frames, where time has jumped."""
        if packet.epoch > self._epoch:
            self._synchronizer.reset(stamp_ns)
            self._runner.frames.reset()
            self._lost["stale"] += sum(len(held.packets) for held in self._held)
            self._held.clear()
            self._newest_ns.clear()
        self._newest_ns[packet.port] = max(stamp_ns, self._newest_ns.get(packet.port, stamp_ns))
        self._epoch = packet.epoch

    def _hold(self, sets: Iterable[Mapping[str, Packet]]) -> None:
        for one in sets:
            packets = tuple(one.values())
            stamps = [packet.message.header.stamp_ns for packet in packets if packet.message]
            self._held.append(_HeldSet(self._last, max(stamps), packets))
            self._came = None

    def _release(self, at_once: bool) -> Iterator[NodeStep]:
        """The sets that wait for transforms no longer, under the number of the packet before."""
        while self._held and not self._awaits_frames(self._held[0], at_once):
            yield self._step(self._last, self._held.popleft().packets)

    def _awaits_frames(self, held: _HeldSet, at_once: bool) -> bool:
        """True while a set waits; live by the clock, else by the times of recording."""
        if at_once:
            waited_ns = time.monotonic_ns() - held.since.arrival_ns
        else:
            waited_ns = (self._last.log_ns or 0) - (held.since.log_ns or 0)
        is_late = waited_ns >= FRAMES_WAIT_S * 1e9 or len(self._held) > _MOST_HELD
        if is_late or not self._type.frames or "tf" in (one.port for one in held.packets):
            return False
        own = self._runner.own_frames
        return self._runner.frames.is_awaited(held.stamp_ns, FRAMES_WAIT_S, own)

    def _step(self, packet: Packet, packets: tuple[Packet, ...]) -> NodeStep:
        self._last_set = packets
        return NodeStep(packet._replace(message=None, more=True), packets)

    def _warn_if_unmatched(self, port: str) -> None:
        """Warn if messages come and none are matched."""
        if self._came is None:
            return
        self._came[port] += 1
        if self._came[port] >= _UNMATCHED:
            came = ", ".join(self._describe(one, self._came[one]) for one in self._type.stepped)
            self._warn(f"no messages matched by {self._type.sync} yet: {came}")
            self._came = None

    def _describe(self, port: str, count: int) -> str:
        topic = self._topics.get(port, port)
        if not count:
            return f"no message on {topic}"
        return f"{count} on {topic}, stamps up to {self._newest_ns[port] / 1e9:.6f} s"

    def _warn(self, what: str) -> None:
        if what in self._warnings or len(self._warnings) > _MOST_WARNINGS:
            return
        self._warnings.add(what)
        name = self._runner.node.name
        log.warning("%s: %s (further occurrences suppressed)", name, what)
        if len(self._warnings) > _MOST_WARNINGS:
            log.warning("%s: further warnings suppressed", name)
