"""The live parameters of a node in another process."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TimedOut
from functools import partial
from typing import Any

from ros_visualise.core import params, supervision
from ros_visualise.core.errors import OpenError, ParameterError, Unreachable
from ros_visualise.core.params import Parameters, specs
from ros_visualise.nodes import NodeType, NoParams, SourceType
from ros_visualise.runtime.middleware import Transport

log = logging.getLogger(__name__)

_ANSWER_S = 2.0
"""Longest time that a node takes to answer."""
_GONE_S = 2.0
_ECHO_S = 0.25


class RemoteParameters(Parameters[Any]):
    """The live parameters of a remote node, also as others change them.

    ``current`` has no fields until the node has reported its parameters (see `wait`). When the node
    returns after its end, so do they.

    Args:
        transport: of the graph.
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
        self._is_lost = False
        self._calls = threading.Lock()
        self._calling: threading.Thread | None = None
        self._warned: set[str] = set()
        self._client = transport.follow_parameters(node, self)

    def wait(self, timeout_s: float) -> bool:
        """Wait until the node has reported its parameters; False if it has not in time."""
        return self._ready.wait(timeout_s)

    @property
    def connected(self) -> bool:
        """True if the node is connected."""
        return self._client.connected

    def follow(self) -> None:
        """Log once that the connection is lost or back; to be called while the graph is there.

        If all nodes end together, this one ends too, before it misses another.
        """
        connected = self.connected
        if connected or not self._ready.is_set():
            self._seen_s = time.monotonic()
        if connected and self._is_lost:
            log.info("%s: connected again", self._name)
            self._is_lost = False
        elif not self._is_lost and time.monotonic() - self._seen_s > _GONE_S:
            log.warning("%s: connection lost; will reconnect", self._name)
            self._is_lost = True

    def update(self, changes: Mapping[str, Any]) -> Any:
        """Have the node apply all changes or none; returns its parameters after that.

        Raises:
            ParameterError: as `ros_visualise.core.params.update`, or the node rejects them.
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
        """The node has these parameters; see `ros_visualise.runtime.transport`."""
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
        """Have the node set values; returns its answer, or fails in bounded time."""
        if not self._calls.acquire(timeout=_ANSWER_S):
            raise self._no_answer()
        try:
            if self._calling is not None and self._calling.is_alive():  # an earlier call hangs
                raise self._no_answer()
            answer: Future[Mapping[str, Any]] = Future()
            self._calling = supervision.start(self._name, partial(self._call, values, answer))
            return answer.result(_ANSWER_S)
        except ParameterError as error:
            raise ParameterError(f"{self._name} rejects it: {error}") from None
        except (Unreachable, TimedOut) as error:
            log.debug("%s: %s", self._name, error)
            raise self._no_answer() from None
        finally:
            self._calls.release()

    def _call(self, values: Mapping[str, Any], answer: Future[Mapping[str, Any]]) -> None:
        """Call the node, on a thread that is abandoned if no answer comes."""
        try:
            answer.set_result(self._client.set(values))
        except (ParameterError, Unreachable) as error:
            answer.set_exception(error)
        finally:
            if not answer.done():  # a bug, which the supervisor reports
                answer.set_exception(Unreachable("the call failed"))

    def _no_answer(self) -> OpenError:
        return OpenError(f"{self._name} does not answer; is it still running?")

    def _has_come(self, asked: int, answer: Mapping[str, Any]) -> bool:
        return any(number > asked and values == answer for number, values in self._recent)

    def _apply(self, values: Mapping[str, Any]) -> None:
        """Take over the node's values, except for those outside their declared range."""
        fitting = {}
        for spec in specs(self.current):
            if spec.name in values:
                try:
                    fitting[spec.name] = spec.coerce(values[spec.name])
                except ParameterError as error:
                    self._warn_of(spec.name, error)
        self.take(fitting)

    def _warn_of(self, name: str, error: ParameterError) -> None:
        if name not in self._warned:
            self._warned.add(name)
            log.warning("%s: value outside its declared range: %s", self._name, error)
