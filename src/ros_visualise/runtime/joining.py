"""Puts together what comes to a node: the messages of several inputs, and the frames of their time.

It works behind the node's inbox, on its thread: a node that waited for one input without taking the
others would hold up a source that both are made from, for ever.
"""

from __future__ import annotations

import logging
import time
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple, Protocol

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
"""So long a message may wait for the transforms of its time."""

_KEPT = 10  # images of an input that wait in the inbox: which of them has a partner is seen later
_SILENT = 20  # messages of an input without any joined: somebody should be told
_MOST_HELD = 30
_MOST_SAID = 10
_ROUND = 1000
_LOOK_S = 0.05


class Question(NamedTuple):
    """What a node is to answer: the packets of one step, and the number that the answer gets.

    Without packets it has nothing for that number.
    """

    number: Packet
    packets: tuple[Packet, ...]


class Joining(Protocol):
    """Takes packets from a node's inbox, and asks the node for answers.

    Attributes:
        origins: topics beside the node's inputs whose numbers it needs.
    """

    origins: tuple[str, ...]

    @property
    def dropped(self) -> Counter[str]:
        """Messages that came into no step, by reason and input."""

    def keep(self, kind: type[Message]) -> int:
        """How many messages of an input may wait in the inbox."""

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterable[Question]:
        """What there is to answer by now; each step is to be done before the next is asked for."""

    def finish(self) -> Iterable[Question]:
        """What there still is when all inputs have ended."""


def joining_of(graph: Graph, runner: NodeRunner) -> Joining:
    """What a node's declaration asks for."""
    if runner.node.type.sync == EACH and not runner.node.type.frames:
        return _Alone(runner)
    return _Together(graph, runner)


class _Alone:
    """Every message by itself."""

    def __init__(self, runner: NodeRunner) -> None:
        self.origins: tuple[str, ...] = ()
        self.dropped: Counter[str] = Counter()
        self._stats = runner.stats

    def keep(self, kind: type[Message]) -> int:
        return kind.waiting

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterable[Question]:
        packet = inbox.take(timeout_s)
        if packet is None or packet.number == FINISHED:
            return ()
        if packet.message is None:
            return (Question(packet, ()),)
        self._stats.received += 1
        return (Question(packet, (packet,)),)

    def finish(self) -> Iterable[Question]:
        return ()


class _Held(NamedTuple):
    """A set that waits for the transforms of its time."""

    since: Packet
    stamp_ns: int
    packets: tuple[Packet, ...]


class _Together:
    """Messages of several inputs, each set with the frames as they were known then.

    Where nothing is dropped, packets are taken in the order of their source numbers, so that the
    same input makes the same sets, and shows the node the same frames, however the threads run.
    Live, they are taken as they come, and of sets with images only the newest.
    """

    def __init__(self, graph: Graph, runner: NodeRunner) -> None:
        node = runner.node
        self._runner = runner
        self._stats = runner.stats
        self._type = node.type
        self._topics = dict(node.inputs)
        self._order = Ordering(graph, tuple(dict.fromkeys(node.inputs.values())), apart=True)
        self.origins = tuple(t for t in self._order.inputs if t not in node.inputs.values())
        self._synchronizer = synchronizer(
            node.type.sync, [port for port in node.inputs if port in node.type.stepped]
        )
        self._is_large = any(kind.waiting == 1 for kind in node.type.stepped.values())
        self._lost: Counter[str] = Counter()
        self._held: deque[_Held] = deque()
        self._last = Packet(0, None, 0)
        self._last_set: tuple[Packet, ...] = ()
        self._answered = self._epoch = 0
        self._newest_ns: dict[str, int] = {}
        self._came: Counter[str] | None = Counter()  # until something is joined or said
        self._said: set[str] = set()
        self._ending: set[str] = set()  # inputs on which nothing more comes

    @property
    def dropped(self) -> Counter[str]:
        """See `Joining`."""
        unmatched = self._synchronizer.dropped.copy().items()
        return self._lost + Counter({f"{why} {port}": n for (port, why), n in unmatched})

    def keep(self, kind: type[Message]) -> int:
        """See `Joining`."""
        return max(kind.waiting, _KEPT)

    def take(self, inbox: Inbox, timeout_s: float | None) -> Iterator[Question]:
        """See `Joining`."""
        packet = inbox.take(_LOOK_S if self._held else timeout_s)
        if not inbox.lossless:
            yield from self._take_newest(packet, inbox)
        elif packet is not None:
            yield from self._put(packet, at_once=False)

    def finish(self) -> Iterator[Question]:
        """See `Joining`."""
        for topic in self._order.inputs:
            self._order.finish(topic)
        yield from self._ready(at_once=False)
        self._hold(self._synchronizer.finish())
        for held in self._held:
            yield self._ask(self._last._replace(number=END), held.packets)

    def _take_newest(self, packet: Packet | None, inbox: Inbox) -> list[Question]:
        """All that waits; of several sets with images only the newest."""
        questions: list[Question] = []
        for _ in range(_ROUND):
            if packet is None:
                break
            questions += self._put(packet, at_once=True)
            packet = inbox.take(0)
        questions += self._released(at_once=True)
        sets = [question for question in questions if question.packets]
        for question in sets[:-1] if self._is_large else ():
            self._lost["queue"] += len(question.packets)
            questions.remove(question)
        return questions

    def _put(self, packet: Packet, at_once: bool) -> Iterator[Question]:
        if packet.again:
            yield Question(packet, self._last_set)
            return
        if packet.message is not None:
            self._stats.received += 1
        self._order.put(self._topics.get(packet.port, packet.port), packet)
        yield from self._ready(at_once)
        if packet.number == FINISHED and packet.port in self._type.stepped:
            self._ending.add(packet.port)
        self._end_inputs()
        if self._order.answered > self._answered:
            self._answered = self._order.answered
            yield Question(packet._replace(number=self._answered, message=None, more=False), ())

    def _ready(self, at_once: bool) -> Iterator[Question]:
        while (topic := self._order.first(at_once)) is not None:
            self._last = packet = self._order.take(topic)
            self._gather(packet)
            yield from self._released(at_once)

    def _end_inputs(self) -> None:
        """End inputs of the synchronizer, once it has all of their messages."""
        for port in [p for p in self._ending if not self._order.waits(self._topics[p])]:
            self._ending.remove(port)
            self._synchronizer.end(port)

    def _gather(self, packet: Packet) -> None:
        """Give a packet to the synchronizer or to the frame tree."""
        port, message = packet.port, packet.message
        assert message is not None
        if packet.epoch < self._epoch:
            self._lost[f"stale {port}"] += 1
            return
        self._reset_if_time_jumped(packet)
        if self._type.frames and port in TRANSFORMS:
            self._learn(packet)
        if port in self._type.stepped:
            stamp_ns = message.header.stamp_ns
            self._hold(self._synchronizer.put(port, stamp_ns, packet, message.nbytes))
            self._tell_if_silent(port)

    def _hold(self, sets: Iterable[Mapping[str, Packet]]) -> None:
        for one in sets:
            packets = tuple(one.values())
            stamps = [packet.message.header.stamp_ns for packet in packets if packet.message]
            self._held.append(_Held(self._last, max(stamps), packets))
            self._came = None

    def _released(self, at_once: bool) -> Iterator[Question]:
        """The sets that wait for no transforms any more, under the number of the packet before."""
        while self._held and not self._waits(self._held[0], at_once):
            yield self._ask(self._last, self._held.popleft().packets)

    def _waits(self, held: _Held, at_once: bool) -> bool:
        waited_ns = self._waited_ns(held.since, at_once)
        is_late = waited_ns >= FRAMES_WAIT_S * 1e9 or len(self._held) > _MOST_HELD
        if is_late or not self._type.frames or "tf" in (one.port for one in held.packets):
            return False
        return self._runner.frames.is_awaited(held.stamp_ns, FRAMES_WAIT_S, self._runner.told)

    def _waited_ns(self, since: Packet, at_once: bool) -> int:
        """How long ago a packet came: live by the clock, else by the times of recording."""
        if at_once:
            return time.monotonic_ns() - since.arrival_ns
        return (self._last.log_ns or 0) - (since.log_ns or 0)

    def _ask(self, packet: Packet, packets: tuple[Packet, ...]) -> Question:
        self._last_set = packets
        return Question(packet._replace(message=None, more=True), packets)

    def _learn(self, packet: Packet) -> None:
        try:
            self._runner.frames.add(content(packet.message), packet.port == "tf_static")
        except (DamagedMessage, WrongTransforms) as error:
            self._lost[f"wrong {packet.port}"] += 1
            self._say(f"{self._topics[packet.port]}: {error}")

    def _reset_if_time_jumped(self, packet: Packet) -> None:
        """Forget what waits, and frames that moved, where time has jumped."""
        assert packet.message is not None
        port, stamp_ns = packet.port, packet.message.header.stamp_ns
        if packet.epoch > self._epoch:
            self._synchronizer.reset(stamp_ns)
            self._runner.frames.reset()
            self._lost["stale"] += sum(len(held.packets) for held in self._held)
            self._held.clear()
            self._newest_ns.clear()
        self._newest_ns[port] = max(stamp_ns, self._newest_ns.get(port, stamp_ns))
        self._epoch = packet.epoch

    def _tell_if_silent(self, port: str) -> None:
        """Say it when messages come and none are joined."""
        if self._came is None:
            return
        self._came[port] += 1
        if self._came[port] >= _SILENT:
            came = ", ".join(self._tell_of(one) for one in self._type.stepped)
            self._say(f"no messages matched by {self._type.sync} yet: {came}")
            self._came = None

    def _tell_of(self, port: str) -> str:
        assert self._came is not None
        topic = self._topics.get(port, port)
        if not self._came[port]:
            return f"no message on {topic}"
        return f"{self._came[port]} on {topic}, stamps up to {self._newest_ns[port] / 1e9:.6f} s"

    def _say(self, what: Any) -> None:
        if what in self._said or len(self._said) > _MOST_SAID:
            return
        self._said.add(what)
        name = self._runner.node.name
        log.warning("%s: %s (said once)", name, what)
        if len(self._said) > _MOST_SAID:
            log.warning("%s: more such faults are only counted", name)
