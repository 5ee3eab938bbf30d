"""The live parameters of a node in another process."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import Any

from ros_visualise.core import params, supervision
from ros_visualise.core.errors import OpenError, ParameterError, Unreachable
from ros_visualise.core.params import Parameters, specs
from ros_visualise.nodes import NodeType, NoParams, SourceType
from ros_visualise.runtime.middleware import Transport

log = logging.getLogger(__name__)

_ANSWER_S = 2.0
"""A node that takes longer to answer counts as gone."""
_GONE_S = 2.0
_ECHO_S = 0.25


class RemoteParameters(Parameters[Any]):
    """A node's parameters, whoever changes them.

    ``current`` has no fields until the node has told of its parameters (see `wait`). When the node
    comes back after its end, so do they.

    Args:
        transport: what the node is reached by.
        node: the name under which it has them, such as ``/edge_detector``.

    Attributes:
        node: our own node, if it is one.
    """

    def __init__(self, transport: Transport, node: str) -> None:
        super().__init__(NoParams())
        self.node: NodeType | SourceType | None = None
        self._name = node.removeprefix("/")
        self._ready = threading.Event()
        self._came = threading.Condition()
        self._count = 0
        self._recent: deque[tuple[int, Mapping[str, Any]]] = deque(maxlen=64)
        self._seen_s = time.monotonic()
        self._is_missed = False
        self._calls = threading.Lock()
        self._calling: threading.Thread | None = None
        self._refused: set[str] = set()
        self._client = transport.follow_parameters(node, self)

    def wait(self, timeout_s: float) -> bool:
        """Wait until the node has told of its parameters; whether it has."""
        return self._ready.wait(timeout_s)

    @property
    def is_there(self) -> bool:
        """Whether the node is connected."""
        return self._client.connected

    def follow(self) -> None:
        """Say, once, that the node has gone or is back; to be called while the graph is there.

        Where all nodes end together this one does too, before it has missed another.
        """
        is_there = self.is_there
        if is_there or not self._ready.is_set():
            self._seen_s = time.monotonic()
        if is_there and self._is_missed:
            log.info("%s is back", self._name)
            self._is_missed = False
        elif not self._is_missed and time.monotonic() - self._seen_s > _GONE_S:
            log.warning("%s is gone; its parameters come back with it", self._name)
            self._is_missed = True

    def update(self, changes: Mapping[str, Any]) -> Any:
        """Have the node apply all changes or none; returns what then holds.

        Raises:
            ParameterError: as `ros_visualise.core.params.update`, or the node itself refuses.
            OpenError: the node does not answer.
        """
        if not self.wait(_ANSWER_S):
            raise self._no_answer()
        wanted = params.update(self.current, changes)
        with self._came:
            asked = self._count
        answer = self._set({name: getattr(wanted, name) for name in changes})
        with self._came:
            self._came.wait_for(lambda: self._has_come(asked, answer), _ECHO_S)
            overtaken = self._count > asked
        if not overtaken:
            self._apply(answer)
        return self.current

    def declared(self, params: type, node: NodeType | SourceType | None) -> None:
        """The node has these parameters; see `ros_visualise.runtime.middleware`."""
        with self._lock:
            self.node = node
            self.current = params()

    def updated(self, values: Mapping[str, Any]) -> None:
        """The node has these values now."""
        with self._lock:
            self._apply(values)
        with self._came:
            self._count += 1
            self._recent.append((self._count, values))
            self._came.notify_all()
        self._ready.set()

    def close(self) -> None:
        """Follow it no longer."""
        self._client.close()

    def _set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Ask the node to set values; its answer, or an error in bounded time."""
        answers: list[Mapping[str, Any] | ParameterError] = []
        if self._calls.acquire(timeout=_ANSWER_S):
            try:
                self._ask_aside(values, answers)
            finally:
                self._calls.release()
        if not answers:
            raise self._no_answer()
        if isinstance(answers[0], ParameterError):
            raise answers[0]
        return answers[0]

    def _no_answer(self) -> OpenError:
        return OpenError(f"{self._name} does not answer; is it still running?")

    def _ask_aside(
        self, values: Mapping[str, Any], answers: list[Mapping[str, Any] | ParameterError]
    ) -> None:
        """Ask on a thread that is left behind when no answer comes."""
        if self._calling is None or not self._calling.is_alive():
            self._calling = supervision.start(self._name, partial(self._ask, values, answers))
            self._calling.join(_ANSWER_S)

    def _ask(
        self, values: Mapping[str, Any], answers: list[Mapping[str, Any] | ParameterError]
    ) -> None:
        try:
            answers.append(self._client.set(values))
        except ParameterError as error:
            answers.append(ParameterError(f"{self._name} refuses: {error}"))
        except Unreachable as error:
            log.debug("%s: %s", self._name, error)

    def _has_come(self, asked: int, answer: Mapping[str, Any]) -> bool:
        return any(number > asked and values == answer for number, values in self._recent)

    def _apply(self, values: Mapping[str, Any]) -> None:
        """Take over what the node has, but for what contradicts its own description."""
        fitting = {}
        for spec in specs(self.current):
            if spec.name in values:
                try:
                    fitting[spec.name] = spec.coerce(values[spec.name])
                except ParameterError as error:
                    self._say_refused(spec.name, error)
        self.take(fitting)

    def _say_refused(self, name: str, error: ParameterError) -> None:
        if name not in self._refused:
            self._refused.add(name)
            log.warning("%s has a value outside of what it declares: %s", self._name, error)
