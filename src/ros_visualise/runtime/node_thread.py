"""A node of a graph on a thread of its own."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from ros_visualise.runtime.joining import Joining, Question
from ros_visualise.runtime.queues import END, Inbox, Packet
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.runner import NOTHING, NodeRunner
from ros_visualise.runtime.topics import Consumer, Topic

_TICK_S = 0.1


class InputPort:
    """One input of a node: marks what comes in, on its way to the one inbox.

    Args:
        inbox: of the node.
        port: the input's name.
        keep: how many of its messages may wait.
        closed: called when nothing more comes.
    """

    def __init__(self, inbox: Inbox, port: str, keep: int, closed: Callable[[], None]) -> None:
        self._inbox, self._port, self._closed = inbox, port, closed
        self._keep = keep

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        self._inbox.put(packet._replace(port=self._port), self._keep)

    def close(self) -> None:
        """Nothing more comes."""
        self._inbox.finish(self._port)
        self._closed()


class NumbersOf:
    """Tells a node which numbers a topic has that it does not listen to, but is made from."""

    def __init__(self, topic: str, inbox: Inbox) -> None:
        self._topic, self._inbox = topic, inbox

    def put(self, packet: Packet) -> None:
        """Take a number."""
        self._inbox.put(packet._replace(message=None, port=self._topic))

    def close(self) -> None:
        """Nothing more comes."""
        self._inbox.finish(self._topic)


class NodeThread:
    """Takes one node's messages, runs its steps, publishes what comes out.

    Args:
        runner: the node.
        joining: puts the messages of its inputs together.
        outputs: output name -> topic.
        ticks: ask the node now and then what is due. That goes by the clock on the wall, and would
            make two runs of the same recording differ.
    """

    def __init__(
        self, runner: NodeRunner, joining: Joining, outputs: Mapping[str, Topic], ticks: bool
    ) -> None:
        self.runner = runner
        self._joining = joining
        self._tick_s = _TICK_S if ticks and not runner.stateless else None
        self._ticked_s = time.monotonic()
        self.inbox = Inbox(lossless=False)
        kinds = runner.node.type.inputs
        ports = runner.node.inputs.items()
        self.inputs: list[tuple[str, Consumer]] = [
            (topic, InputPort(self.inbox, port, joining.keep(kinds[port]), self._input_closed))
            for port, topic in ports
        ]
        self._open = len(self.inputs)
        self.inputs += [(topic, NumbersOf(topic, self.inbox)) for topic in joining.origins]
        self._closing = threading.Lock()
        self._outputs = outputs
        self._last = Packet(0, None, 0)
        self._at_work = threading.Lock()
        self._is_dead = False

    def run(self) -> None:
        """Until the inbox is closed and empty."""
        try:
            while not self.inbox.ended:
                self._answer(self._joining.take(self.inbox, self._tick_s))
                self._tick_in_time()
            self._answer(self._joining.finish())
            with self._at_work:
                self._last = self._last._replace(number=END)
                self._publish(self.runner.finish())
        except BaseException:
            self._is_dead = True
            raise
        finally:
            self.inbox.close(discard=True)
            for topic in self._outputs.values():
                topic.finish()

    def act(self, name: str) -> None:
        """Run an action of the node between two steps."""
        self._say(lambda: self.runner.act(name))

    def repeat_last(self) -> None:
        """Process the last message once more, with the parameters as they are now."""
        if self.runner.stateless:
            self.inbox.repeat()

    def report(self) -> NodeReport:
        """Counts, latencies and the node's own figures."""
        report = self.runner.report()
        dropped = Counter(report.dropped) + self._joining.dropped
        dropped["queue"] += self.inbox.dropped
        received = report.received + self.inbox.dropped
        if self._is_dead:  # what it was at, and all that came since
            dropped["error"] += 1 + self.inbox.let_go
            received += self.inbox.let_go
        return replace(report, received=received, dropped=dict(+dropped))

    def _answer(self, questions: Iterable[Question]) -> None:
        for number, packets in questions:
            with self._at_work:
                self._last = number
                self._publish(self.runner.step(*packets) if packets else NOTHING)

    def _tick_in_time(self) -> None:
        if self._tick_s is not None and time.monotonic() - self._ticked_s >= self._tick_s:
            self._ticked_s = time.monotonic()
            self._say(self.runner.tick)

    def _say(self, ask: Callable[[], Mapping[str, Any]]) -> None:
        """Publish what the node answers between two steps, if anything."""
        with self._at_work:
            if answer := ask():
                self._publish(answer)

    def _publish(self, answer: Mapping[str, Any]) -> None:
        for port, topic in self._outputs.items():
            message = answer.get(port)
            topic.publish(self._last._replace(message=message, port="", again=False))

    def _input_closed(self) -> None:
        with self._closing:  # publishers end when they like
            self._open -= 1
            is_last = self._open == 0
        if is_last:
            self.inbox.close()
