"""Runs one node's steps, whichever runtime brings the messages."""

from __future__ import annotations

import logging
import time
import traceback
from collections.abc import Mapping
from typing import Any

from ros_visualise.data import Image
from ros_visualise.errors import DamagedMessage, RosVisualiseError
from ros_visualise.graph import Node
from ros_visualise.messages.recorded import content
from ros_visualise.nodes import NodeType
from ros_visualise.params import Parameters
from ros_visualise.runtime.stats import NodeStats

log = logging.getLogger(__name__)

_DISORDER_NS = 1_000_000_000
"""Messages come late, and those who send transforms disagree; only further back, time has jumped.

Images come from one camera, and any that goes back begins a stream anew.
"""

NOTHING: Mapping[str, Any] = {}
"""A node's answer when it has nothing for this message."""


class NodeRunner:
    """One node at work: its state, its live parameters, its counts.

    An error in a step costs that one message: it is said once for each place in the code where it
    comes from, counted under ``error``, and ``failed`` stays set.
    """

    def __init__(self, node: Node, parameters: Parameters[Any]) -> None:
        assert isinstance(node.type, NodeType)
        self.node = node
        self.stats = NodeStats()
        self.failed = False
        self.stateless = node.type.stateless
        self._type = node.type
        self._parameters = parameters
        self._state = node.type.make(parameters.current)
        self._last_stamps_ns: dict[str, int] = {}
        self._said: set[tuple[type, str, int | None]] = set()

    def step(self, inputs: Mapping[str, Any], arrival_ns: int) -> Mapping[str, Any]:
        """What the node makes of these messages: output name -> message.

        Args:
            inputs: input name -> message.
            arrival_ns: monotonic time at which the source let go of what this was made from.
        """
        self.stats.received += 1
        started_ns = time.monotonic_ns()
        try:
            decoded = {port: content(message) for port, message in inputs.items()}
            self._reset_if_time_went_back(decoded)
            answer = self._state.step(**decoded, params=self._parameters.current)
            outputs = self._by_output(answer)
        except DamagedMessage as error:
            self.stats.dropped["damaged"] += 1
            self._say(error, ", ".join(self.node.inputs[port] for port in inputs))
            return NOTHING
        except Exception as error:
            self.stats.dropped["error"] += 1
            self._fail(error)
            return NOTHING
        if not outputs and self._type.drops:
            self.stats.dropped[self._type.drops] += 1
        else:
            self.stats.answered(arrival_ns, started_ns)
        return outputs

    def act(self, name: str) -> Mapping[str, Any]:
        """Run an action; what the node answers to it."""
        try:
            return self._by_output(getattr(self._state, name)())
        except Exception as error:
            self._fail(error)
            return NOTHING

    def tick(self) -> Mapping[str, Any]:
        """What is due although no message came."""
        try:
            return self._by_output(self._state.tick(self._parameters.current))
        except Exception as error:
            self._fail(error)
            return NOTHING

    def finish(self) -> Mapping[str, Any]:
        """What the node still has at the end of the stream."""
        try:
            return self._by_output(self._state.finish())
        except Exception as error:
            self._fail(error)
            return NOTHING

    def report(self) -> dict[str, Any]:
        """Counts and latencies, and the node's own figures."""
        try:
            own = self._state.report()
        except Exception as error:
            self._fail(error)
            own = {}
        return {**self.stats.report(), **own}

    def _by_output(self, answer: Any) -> Mapping[str, Any]:
        if answer is None:
            return NOTHING
        declared = self._type.outputs
        outputs = answer if isinstance(answer, dict) else {next(iter(declared), ""): answer}
        for name, message in outputs.items():
            if name not in declared or not isinstance(message, (declared[name], type(None))):
                wanted = ", ".join(f"{port}: {kind.__name__}" for port, kind in declared.items())
                given = f"{name or 'something'}: {type(message).__name__}"
                raise RosVisualiseError(f"answers with {given}, but declares {wanted or 'nothing'}")
        return outputs

    def _reset_if_time_went_back(self, inputs: Mapping[str, Any]) -> None:
        for port, message in inputs.items():
            stamp_ns = message.header.stamp_ns
            patience_ns = 0 if isinstance(message, Image) else _DISORDER_NS
            if stamp_ns < self._last_stamps_ns.get(port, 0) - patience_ns:
                self._state.reset()
                self._last_stamps_ns.clear()
            self._last_stamps_ns[port] = max(stamp_ns, self._last_stamps_ns.get(port, 0))

    def _fail(self, error: Exception) -> None:
        self.failed = True
        self._say(error)

    def _say(self, error: Exception, topic: str = "") -> None:
        origin = traceback.extract_tb(error.__traceback__)[-1]
        kind = (type(error), origin.filename, origin.lineno)
        if kind not in self._said:
            self._said.add(kind)
            bug = not isinstance(error, RosVisualiseError)
            where = f"{self.node.name}: {topic}" if topic else self.node.name
            log.error("%s: %s (said once)", where, error, exc_info=error if bug else None)
