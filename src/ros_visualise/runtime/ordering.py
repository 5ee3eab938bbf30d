"""The order in which the messages of a running graph belong, however its threads run."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection

from ros_visualise.graph import Graph
from ros_visualise.messages import type_name
from ros_visualise.messages.recorded import TopicType, recorded_ns
from ros_visualise.runtime.queues import END, FINISHED, Packet


def recordable(graph: Graph) -> dict[str, TopicType]:
    """What of a graph can be recorded: its topics, and those by which its source is told."""
    return {name: topic.ros for name, topic in graph.topics.items()} | _told(graph)


class Ordering:
    """Puts packets in order: by the number that the source gave them, then by that of the nodes.

    A packet is ready as soon as every recorded node has answered its number, if that number went to
    it; what nodes say at the end, when all have ended. What the source is told from outside the
    graph comes after its newest message.

    What was made of a recorded message has the time under which that is recorded, its log time,
    whatever the stamps say; what nodes say at the end and what the source is told, the newest.

    Args:
        graph: what runs.
        topics: those whose messages are wanted, in the order of `recordable`.
        apart: leave out the numbers of what none of these topics is made from.

    Attributes:
        inputs: topics whose packets it is to be given: also those that numbers come from.
        size: bytes of what waits.
    """

    def __init__(self, graph: Graph, topics: Collection[str], apart: bool = False) -> None:
        self.size = 0
        self._told = _told(graph)
        self._followers = _followers(graph, topics)
        if apart:
            self._followers = {
                begin: made for begin, made in self._followers.items() if made or begin in topics
            }
        self.inputs = tuple(dict.fromkeys((*self._followers, *topics)))
        self._waiting: dict[str, deque[Packet]] = {topic: deque() for topic in topics}
        self._place = {topic: place for place, topic in enumerate(topics)}
        self._answered = {topic: -1 for topic in self.inputs if topic not in self._told}
        self._owed: dict[str, deque[int]] = {topic: deque() for topic in self.inputs}
        self._begun = -1  # the newest number that came from a source
        self._begun_ns: int | None = None  # and its log time

    @property
    def ended(self) -> bool:
        """Whether nothing more is to come."""
        return min(self._answered.values(), default=FINISHED) == FINISHED

    @property
    def answered(self) -> int:
        """The newest number that all have answered to whom it went."""
        return min(self._begun, *(owed[0] - 1 for owed in self._owed.values() if owed), END)

    def waits(self, topic: str) -> bool:
        """Whether a message of a topic waits."""
        return bool(self._waiting.get(topic))

    def put(self, topic: str, packet: Packet) -> None:
        """Take the publisher's answer for one number, its end, or what the source is told."""
        if packet.number == FINISHED:
            self.finish(topic)
            return
        if topic in self._told:
            packet = packet._replace(number=max(self._begun, 0), log_ns=self._begun_ns)
        else:
            self._count(topic, packet)
        if topic in self._waiting and packet.message is not None:
            self._waiting[topic].append(packet)
            self.size += _size(packet)

    def finish(self, topic: str) -> None:
        """Nothing more comes on this topic."""
        self._answered[topic] = FINISHED
        self._owed[topic].clear()

    def first(self, at_once: bool) -> str | None:
        """The topic of the next packet if it is ready, or if it is wanted at once."""
        waiting = [
            (packets[0].number, self._place[topic], topic)
            for topic, packets in self._waiting.items()
            if packets
        ]
        if not waiting:
            return None
        number, _, topic = min(waiting)
        return topic if at_once or self._is_answered(number) else None

    def take(self, topic: str) -> Packet:
        """The next packet, of the topic that `first` gave; it has a log time."""
        packet = self._waiting[topic].popleft()
        self.size -= _size(packet)
        is_new = packet.log_ns is None or packet.number == END
        log_ns = self._begun_ns if is_new else packet.log_ns
        return packet._replace(log_ns=recorded_ns(packet.message) if log_ns is None else log_ns)

    def _count(self, topic: str, packet: Packet) -> None:
        """Note who owes an answer to this number, or that it was given."""
        number = packet.number
        done = number - 1 if packet.more else number
        self._answered[topic] = max(self._answered[topic], done)
        if topic in self._followers:
            self._begun, self._begun_ns = max(self._begun, number), packet.log_ns
            for follower in self._followers[topic]:
                if self._answered[follower] < number:
                    self._owed[follower].append(number)
        owed = self._owed[topic]
        while owed and owed[0] <= done:
            owed.popleft()

    def _is_answered(self, number: int) -> bool:
        """Whether nothing can come any more that belongs before this number, or to it."""
        if number == END:
            return self.ended
        if any(owed and owed[0] <= number for owed in self._owed.values()):
            return False
        return number <= self._begun or all(self._answered[t] == FINISHED for t in self._followers)


def _told(graph: Graph) -> dict[str, TopicType]:
    """Topics from outside the graph that its source listens to, as velocities for a robot."""
    heard = graph.source.inputs.values() if graph.source else ()
    inputs = graph.inputs
    return {topic: TopicType(type_name(inputs[topic])) for topic in heard if topic in inputs}


def _followers(graph: Graph, wanted: Collection[str]) -> dict[str, list[str]]:
    """Topics that numbers come from -> the wanted topics that are made from them."""
    begins = graph.inputs.keys() - _told(graph).keys()
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
