"""A node of a graph on a thread of its own."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from ros_visualise.runtime.node_inputs import NodeInputs, NodeStep
from ros_visualise.runtime.queues import END, Inbox, Packet
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.runner import NOTHING, NodeRunner
from ros_visualise.runtime.topics import CallbackListener, Listener, Topic

_TICK_S, _LIVE_TICK_S = 0.1, 0.005
_MOST_TICKS = 200


class NodeThread:
    """Takes one node's messages, runs its steps, publishes what comes out.

    Args:
        runner: the node.
        inputs: makes the node's steps of the messages in its inbox.
        outputs: output name -> topic.
        ticks: call the node's ``tick`` now and then. That goes by the wall clock, and would make
            two runs of the same recording differ.

    Attributes:
        listeners: each topic that the node needs, with what takes its packets.
    """

    def __init__(
        self, runner: NodeRunner, inputs: NodeInputs, outputs: Mapping[str, Topic], ticks: bool
    ) -> None:
        self.runner = runner
        self._inputs = inputs
        self._tick_s = _TICK_S if ticks and not runner.stateless else None
        if runner.node.type.live:
            self._tick_s = _LIVE_TICK_S
        self._ticked_s = time.monotonic()
        self.inbox = Inbox(lossless=False)
        self.listeners = [
            (topic, self._listener(port)) for port, topic in runner.node.inputs.items()
        ]
        self._open = len(self.listeners)
        self.listeners += [(topic, self._number_listener(topic)) for topic in inputs.origins]
        self._closing = threading.Lock()
        self._outputs = outputs
        self._last = Packet(0, None, 0)
        self._at_work = threading.Lock()
        self._is_dead = False

    def run(self) -> None:
        """Run until the inbox is closed and empty."""
        try:
            while not self.inbox.ended:
                self._answer(self._inputs.take(self.inbox, self._tick_s))
                self._tick_in_time()
            self._answer(self._inputs.finish())
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
        self._publish_answer(lambda: self.runner.act(name))

    def repeat_last(self) -> None:
        """Process the last message once more, with the present parameters."""
        if self.runner.stateless:
            self.inbox.repeat()

    def report(self) -> NodeReport:
        """Counts, latencies and the node's own figures."""
        report = self.runner.report()
        dropped = Counter(report.dropped) + self._inputs.dropped
        dropped["queue"] += self.inbox.dropped
        received = report.received + self.inbox.dropped
        if self._is_dead:  # the message that it died of, and all that came since
            dropped["error"] += 1 + self.inbox.discarded
            received += self.inbox.discarded
        return replace(report, received=received, dropped=dict(+dropped))

    def _listener(self, port: str) -> Listener:
        """Puts the packets of an input into the inbox, under its name."""
        keep = self._inputs.keep(self.runner.node.type.inputs[port])

        def close() -> None:
            self.inbox.finish(port)
            self._input_closed()

        return CallbackListener(
            lambda packet: self.inbox.put(packet._replace(port=port), keep), close
        )

    def _number_listener(self, topic: str) -> Listener:
        """Puts the numbers of a topic into the inbox: inputs are made from it."""
        return CallbackListener(
            lambda packet: self.inbox.put(packet._replace(message=None, port=topic)),
            partial(self.inbox.finish, topic),
        )

    def _answer(self, steps: Iterable[NodeStep]) -> None:
        for answers, packets in steps:
            with self._at_work:
                self._last = answers
                self._publish(self.runner.step(*packets) if packets else NOTHING)

    def _tick_in_time(self) -> None:
        if self._tick_s is not None and time.monotonic() - self._ticked_s >= self._tick_s:
            self._ticked_s = time.monotonic()
            times = _MOST_TICKS if self.runner.node.type.live else 1
            while times and self._publish_answer(self.runner.tick):
                times -= 1

    def _publish_answer(self, ask: Callable[[], Mapping[str, Any]]) -> bool:
        """Publish what the node answers between two steps; false if that is nothing."""
        with self._at_work:
            answer = ask()
            if answer:
                self._publish(answer)
            return bool(answer)

    def _publish(self, answer: Mapping[str, Any]) -> None:
        for port, topic in self._outputs.items():
            message = answer.get(port)
            topic.publish(self._last._replace(message=message, port="", again=False))

    def _input_closed(self) -> None:
        with self._closing:  # publishers end at any time
            self._open -= 1
            is_last = self._open == 0
        if is_last:
            self.inbox.close()
