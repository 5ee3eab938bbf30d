"""A node of a graph on a thread of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.runner import NOTHING, NodeRunner
from ros_visualise.runtime.topics import Topic


class NodeThread:
    """Takes one node's messages, runs its steps, publishes what comes out.

    Args:
        runner: the node.
        port: its input.
        outputs: output name -> topic.
    """

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
