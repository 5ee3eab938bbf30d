"""The order in which the messages of a running graph belong, however its threads run."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from heapq import heappop, heappush

from ros_visualise.graph import Graph
from ros_visualise.messages.recorded import TopicType, recorded_ns
from ros_visualise.runtime.queues import END, FINISHED, Packet


def recordable(graph: Graph) -> dict[str, TopicType]:
    """Topics of a graph that can be recorded: its own, and those that control its source."""
    return {name: topic.ros for name, topic in graph.topics.items()} | _controls(graph)


class Ordering:
    """Puts packets in order: by the number that the source gave them, then by the order of nodes.

    A packet is ready as soon as every recorded node has answered its number, if that number went to
    it; the last answers of nodes, when all have ended. Messages that control the source come after
    its newest message.

    The answer to a message has the same log time, whatever the stamps are; last answers and
    messages that control the source have the newest.

    Args:
        graph: what runs.
        topics: topics of the messages, in the order of `recordable`.
        apart: ignore the numbers of topics that none of these is made from.

    Attributes:
        inputs: topics whose packets it needs: also those that numbers come from.
        size: bytes of waiting messages.
    """

    def __init__(self, graph: Graph, topics: Collection[str], apart: bool = False) -> None:
        self.size = 0
        self._controls = _controls(graph)
        self._followers = _followers(graph, topics)
        if apart:
            self._followers = {
                begin: made for begin, made in self._followers.items() if made or begin in topics
            }
        self.inputs = tuple(dict.fromkeys((*self._followers, *topics)))
        self._waiting: dict[str, deque[Packet]] = {topic: deque() for topic in topics}
        self._place = {topic: place for place, topic in enumerate(topics)}
        self._heads: list[
            tuple[int, int, str]
        ] = []  # a heap: number, place and topic of what waits
        self._answered = {topic: -1 for topic in self.inputs if topic not in self._controls}
        self._open = set(self._answered)  # topics on which something may come
        self._open_begins = set(self._followers)
        self._owed: dict[str, deque[int]] = {topic: deque() for topic in self.inputs}
        self._debts: list[tuple[int, str]] = []  # a heap: the first number that a topic owes
        self._begun = -1  # the newest number that came from a source
        self._begun_ns: int | None = None  # and its log time

    @property
    def ended(self) -> bool:
        """True if nothing more can come."""
        return not self._open

    @property
    def answered(self) -> int:
        """The newest number that all its nodes have answered."""
        return min(self._begun, self._first_owed() - 1, END)

    def waits(self, topic: str) -> bool:
        """True if a message of a topic waits."""
        return bool(self._waiting.get(topic))

    def put(self, topic: str, packet: Packet) -> None:
        """Take an answer to a number, the end of a topic, or a message that controls the source."""
        if packet.number == FINISHED:
            self.finish(topic)
            return
        if topic in self._controls:
            packet = packet._replace(number=max(self._begun, 0), log_ns=self._begun_ns)
        else:
            self._count(topic, packet)
        if topic in self._waiting and packet.message is not None:
            self._waiting[topic].append(packet)
            self.size += _size(packet)
            if len(self._waiting[topic]) == 1:
                self._show_head(topic)

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic."""
        self._answered[topic] = FINISHED
        self._open.discard(topic)
        self._open_begins.discard(topic)
        self._owed[topic].clear()

    def first(self, at_once: bool) -> str | None:
        """The topic of the next packet if it is ready, or in any case if ``at_once``."""
        if not self._heads:
            return None
        number, _, topic = self._heads[0]
        return topic if at_once or self._is_answered(number) else None

    def take(self, topic: str) -> Packet:
        """The next packet, of the topic that `first` returned; it has a log time."""
        packet = self._waiting[topic].popleft()
        heappop(self._heads)
        if self._waiting[topic]:
            self._show_head(topic)
        self.size -= _size(packet)
        is_new = packet.log_ns is None or packet.number == END
        log_ns = self._begun_ns if is_new else packet.log_ns
        return packet._replace(log_ns=recorded_ns(packet.message) if log_ns is None else log_ns)

    def _show_head(self, topic: str) -> None:
        heappush(self._heads, (self._waiting[topic][0].number, self._place[topic], topic))

    def _count(self, topic: str, packet: Packet) -> None:
        """Note which nodes owe an answer to this number, or that one has answered."""
        number = packet.number
        done = number - 1 if packet.more else number
        self._answered[topic] = max(self._answered[topic], done)
        if topic in self._followers:
            self._begun, self._begun_ns = max(self._begun, number), packet.log_ns
            for follower in self._followers[topic]:
                if self._answered[follower] < number:
                    self._owe(follower, number)
        owed = self._owed[topic]
        while owed and owed[0] <= done:
            owed.popleft()
            if owed:
                heappush(self._debts, (owed[0], topic))

    def _owe(self, topic: str, number: int) -> None:
        self._owed[topic].append(number)
        if len(self._owed[topic]) == 1:
            heappush(self._debts, (number, topic))

    def _first_owed(self) -> int:
        """The first number with a missing answer; past all numbers, if none is missing."""
        while self._debts:
            number, topic = self._debts[0]
            owed = self._owed[topic]
            if owed and owed[0] == number:
                return number
            heappop(self._debts)  # it was answered
        return FINISHED

    def _is_answered(self, number: int) -> bool:
        """True if nothing more can come that belongs before this number, or to it."""
        if number == END:
            return self.ended
        if self._first_owed() <= number:
            return False
        return number <= self._begun or not self._open_begins


def _controls(graph: Graph) -> dict[str, TopicType]:
    """Topics from outside the graph that control its source, as velocities of a robot."""
    heard = graph.source.inputs.values() if graph.source else ()
    inputs = graph.inputs
    return {topic: TopicType(inputs[topic].type_name) for topic in heard if topic in inputs}


def _followers(graph: Graph, wanted: Collection[str]) -> dict[str, list[str]]:
    """Topics that numbers come from -> those of the wanted topics that are made from them."""
    begins = graph.inputs.keys() - _controls(graph).keys()
    if graph.source is not None:
        begins |= set(graph.source.outputs.values())
    origins = {topic: {topic} for topic in begins}
    for node in graph.nodes:
        made_from = set().union(*(origins.get(topic, set()) for topic in node.inputs.values()))
        origins |= {topic: made_from for topic in node.outputs.values()}
    return {
        begin: [t for t in wanted if t not in begins and begin in origins.get(t, set())]
        for begin in sorted(begins)
    }


def origins(graph: Graph, topic: str) -> frozenset[str]:
    """The source's topics that a topic of the graph is made from."""
    return frozenset(begin for begin, made in _followers(graph, [topic]).items() if made)


def _size(packet: Packet) -> int:
    return 0 if packet.message is None else int(packet.message.nbytes)
