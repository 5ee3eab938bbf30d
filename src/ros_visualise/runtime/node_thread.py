"""A node of a graph on a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from ros_visualise.data import Message
from ros_visualise.runtime.queues import END, Inbox, Packet
from ros_visualise.runtime.runner import NOTHING, NodeRunner
from ros_visualise.runtime.topics import Topic

_TICK_S = 0.1


class InputPort:
    """One input of a node: marks what comes in, on its way to the one inbox.

    Args:
        inbox: of the node.
        port: the input's name.
        kind: class of its messages.
        closed: called when nothing more comes.
    """

    def __init__(
        self, inbox: Inbox, port: str, kind: type[Message], closed: Callable[[], None]
    ) -> None:
        self._inbox, self._port, self._closed = inbox, port, closed
        self._keep = kind.waiting

    def put(self, packet: Packet) -> None:
        """Take a packet."""
        self._inbox.put(packet._replace(port=self._port), self._keep)

    def close(self) -> None:
        """Nothing more comes."""
        self._closed()


class NodeThread:
    """Takes one node's messages, runs its steps, publishes what comes out.

    Args:
        runner: the node.
        outputs: output name -> topic.
        ticks: ask the node now and then what is due. That goes by the clock on the wall, and would
            make two runs of the same recording differ.
    """

    def __init__(self, runner: NodeRunner, outputs: Mapping[str, Topic], ticks: bool) -> None:
        self.runner = runner
        self._tick_s = _TICK_S if ticks and not runner.stateless else None
        self._ticked_s = time.monotonic()
        self.inbox = Inbox(lossless=False)
        kinds = runner.node.type.inputs
        self.inputs = [
            (topic, InputPort(self.inbox, port, kinds[port], self._input_closed))
            for port, topic in runner.node.inputs.items()
        ]
        self._open = len(self.inputs)
        self._closing = threading.Lock()
        self._outputs = outputs
        self._last = Packet(0, None, 0)
        self._at_work = threading.Lock()

    def run(self) -> None:
        """Until the inbox is closed and empty."""
        try:
            while not self.inbox.ended:
                packet = self.inbox.take(self._tick_s)
                if packet is not None:
                    with self._at_work:
                        self._last = packet
                        self._publish(self._step(packet))
                self._tick_in_time()
            with self._at_work:
                self._last = self._last._replace(number=END)
                self._publish(self.runner.finish())
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

    def report(self) -> dict[str, Any]:
        """Counts, latencies and the node's own figures."""
        report = self.runner.report()
        if self.inbox.dropped:
            report["dropped"]["queue"] = self.inbox.dropped
            report["received"] += self.inbox.dropped
        return report

    def _step(self, packet: Packet) -> Mapping[str, Any]:
        if packet.message is None:
            return NOTHING
        return self.runner.step(packet)

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
            topic.publish(self._last._replace(message=answer.get(port), port=""))

    def _input_closed(self) -> None:
        with self._closing:  # publishers end when they like
            self._open -= 1
            is_last = self._open == 0
        if is_last:
            self.inbox.close()
