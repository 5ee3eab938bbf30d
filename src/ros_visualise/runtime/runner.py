"""The steps of one node, for any runtime."""

from __future__ import annotations

import inspect
import logging
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ros_visualise.core.errors import DamagedMessage, NoTransform, RosVisualiseError, UsageError
from ros_visualise.core.params import Parameters
from ros_visualise.data import Image, Transforms
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.graph import Node
from ros_visualise.messages.recorded import content
from ros_visualise.nodes import NodeType
from ros_visualise.runtime.counters import NodeCounter
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.rejections import origin, require_header
from ros_visualise.runtime.report import NodeReport

log = logging.getLogger(__name__)

NOTHING: Mapping[str, Any] = {}
"""A node's answer without messages."""

_ERRORS = (Exception, SystemExit)  # exit() would end the node's thread silently
T = TypeVar("T")

_PATIENCE_S = 0.2  # a report waits no longer for a step to end


class NodeRunner:
    """One node at work: its state, its live parameters, its counter, and its frames.

    An error in a step costs that one message, which is counted as dropped under ``error``; errors
    elsewhere, as in ``tick`` or ``finish``, are counted separately. Each is logged once for its
    place in the code; ``error`` is the first.

    Raises:
        RosVisualiseError: the node cannot start.
    """

    def __init__(self, node: Node, parameters: Parameters[Any]) -> None:
        self.node = node
        self.counter = NodeCounter()
        self.frames = FrameTree()
        self.own_frames: set[str] = set()  # published by the node: it does not wait for them
        self.error: BaseException | None = None
        self.stateless = node.type.stateless
        self._type = node.type
        self._parameters = parameters
        self._state = make_state(node.name, lambda: node.type.make(parameters.current))
        self._epoch: int | None = None  # of the last message
        self._logged: set[tuple[object, ...]] = set()
        self._uncalibrated: set[str] = set()  # inputs that were warned about
        self._figures: dict[str, Any] = {}  # of its own
        self._at_state = threading.Lock()

    def step(self, *packets: Packet) -> Mapping[str, Any]:
        """The node's answer to one message, or to one set of them: output name -> message."""
        started_ns = time.monotonic_ns()
        packet = max(packets, key=lambda one: (one.epoch, one.arrival_ns))
        if self._is_outdated(packet):
            self.counter.dropped["stale"] += 1
            return NOTHING
        try:
            messages = {one.port: self._content(one) for one in packets}
            if self._type.calibrated:
                self._warn_if_uncalibrated(messages)
            with self._at_state:
                self._reset_if_time_jumped(packet)
                given = by_output(self._type, self._ask(packet, messages))
            outputs = self._passing(given)
        except DamagedMessage:
            self.counter.dropped["damaged"] += 1
            return NOTHING
        except NoTransform as error:
            self.counter.dropped["no transform"] += 1
            self._log(error)
            return NOTHING
        except _ERRORS as error:
            self.counter.dropped["error"] += 1
            self._fail(error)
            return NOTHING
        if len(outputs) < len(given):
            self.counter.dropped["error"] += 1
        elif not outputs and self._type.drops:
            self.counter.dropped[self._type.drops] += 1
        else:
            self.counter.answered(packet.arrival_ns, started_ns)
        return outputs

    def act(self, name: str) -> Mapping[str, Any]:
        """Run an action, and return the node's answer.

        Raises:
            UsageError: the node refuses it, which is no error of the node.
            RosVisualiseError: it failed.
        """
        refusals: list[UsageError] = []

        def ask() -> Any:
            action = getattr(self._state, name)
            takes_params = "params" in inspect.signature(action).parameters
            try:
                return action(self._parameters.current) if takes_params else action()
            except UsageError as refusal:
                refusals.append(refusal)
                return None

        try:
            answer = self._ask_between_steps(ask)
        except RosVisualiseError:
            raise
        except _ERRORS as error:
            what = f"{type(error).__name__}: {error}"
            raise RosVisualiseError(f"{self.node.name}: {name} failed: {what}") from error
        if refusals:
            raise refusals[0]
        return answer

    def tick(self) -> Mapping[str, Any]:
        """The node's answer to a tick."""
        return self._answer(lambda: self._state.tick(self._parameters.current))

    def finish(self) -> Mapping[str, Any]:
        """The node's last answer, at the end of the stream."""
        return self._answer(self._state.finish)

    def report(self) -> NodeReport:
        """Counts, latencies and the node's own figures; during a long step its last ones."""
        if self._at_state.acquire(timeout=_PATIENCE_S):
            try:
                self._figures = self._state.report()
            except _ERRORS as error:
                self._figures = {}
                self.counter.errors += 1
                self._fail(error)
            finally:
                self._at_state.release()
        return replace(self.counter.report(), own=self._figures, gate=self._type.drops)

    def _answer(self, ask: Callable[[], Any]) -> Mapping[str, Any]:
        """The node's answer between two steps; empty if it fails."""
        try:
            return self._ask_between_steps(ask)
        except _ERRORS:
            return NOTHING

    def _ask_between_steps(self, ask: Callable[[], Any]) -> Mapping[str, Any]:
        try:
            with self._at_state:
                given = by_output(self._type, ask())
                outputs = self._passing(given)
        except _ERRORS as error:
            self.counter.errors += 1
            self._fail(error)
            raise
        self.counter.errors += len(given) - len(outputs)
        return outputs

    def _content(self, packet: Packet) -> Any:
        try:
            return content(packet.message)
        except DamagedMessage as error:
            self._log(error, self.node.inputs[packet.port])
            raise

    def _warn_if_uncalibrated(self, messages: Mapping[str, Any]) -> None:
        """Warn once for each input whose images have no calibration."""
        for port, message in messages.items():
            is_new = port not in self._uncalibrated
            if is_new and isinstance(message, Image) and message.camera_info is None:
                self._uncalibrated.add(port)
                topic = self.node.inputs[port]
                log.warning("%s: images on %s have no calibration", self.node.name, topic)

    def _ask(self, packet: Packet, messages: Mapping[str, Any]) -> Any:
        given = {**messages, "params": self._parameters.current}
        if self._type.timed:
            given["arrival_ns"] = packet.log_ns or packet.arrival_ns
        if self._type.frames:
            given["frames"] = self.frames
        return self._state.step(**given)

    def _passing(self, given: Mapping[str, Any]) -> Mapping[str, Any]:
        """The valid messages of an answer; others are counted as errors."""
        return {name: message for name, message in given.items() if self._passes(name, message)}

    def _passes(self, name: str, message: Any) -> bool:
        try:
            if message is not None:
                require_output(self._type, name, message)
                if isinstance(message, Transforms):
                    self.own_frames.update(one.child_frame_id for one in message.transforms)
        except _ERRORS as error:
            self._fail(error, name)
            return False
        return True

    @property
    def failed(self) -> bool:
        """True after an error."""
        return self.error is not None

    def _is_outdated(self, packet: Packet) -> bool:
        """True if time has jumped since, as a message of another input has shown."""
        return self._epoch is not None and packet.epoch < self._epoch

    def _reset_if_time_jumped(self, packet: Packet) -> None:
        if self._epoch not in (None, packet.epoch):
            self._state.reset()
        self._epoch = packet.epoch

    def _fail(self, error: BaseException, topic: str = "") -> None:
        self.error = self.error or error
        self._log(error, topic)

    def _log(self, error: BaseException, topic: str = "") -> None:
        kind = topic, *origin(error)
        if kind in self._logged:
            return
        self._logged.add(kind)
        where = f"{self.node.name}: {topic}" if topic else self.node.name
        bug = None if isinstance(error, RosVisualiseError) else error
        what = error if bug is None else f"{type(error).__name__}: {error}"
        log.error("%s: %s (further occurrences suppressed)", where, what, exc_info=bug)


def by_output(declared: NodeType, answer: Any) -> Mapping[str, Any]:
    """The messages of an answer by their outputs; None for an output without a message."""
    if answer is None:
        return NOTHING
    return answer if isinstance(answer, dict) else {next(iter(declared.outputs), ""): answer}


def require_output(declared: NodeType, name: str, message: Any) -> None:
    """Check that a message can be published.

    Raises:
        DamagedMessage: the output is not declared, or not of this type.
    """
    outputs = declared.outputs
    if name not in outputs or not isinstance(message, outputs[name]):
        wanted = ", ".join(f"{port}: {kind.__name__}" for port, kind in outputs.items())
        given = f"{name or 'something'}: {type(message).__name__}"
        raise DamagedMessage(f"returns {given}, but declares {wanted or 'nothing'}")
    require_header(message)


def make_state(name: str, make: Callable[[], T]) -> T:
    """The state of a node or a source of this name, as ``make`` returns it.

    Raises:
        RosVisualiseError: it cannot start.
    """
    try:
        return make()
    except RosVisualiseError:
        raise
    except _ERRORS as error:
        origin = traceback.extract_tb(error.__traceback__)[-1]
        what = f"{type(error).__name__}: {error}".removesuffix(": ")
        where = f"{origin.filename}, line {origin.lineno}"
        raise RosVisualiseError(f"{name} cannot start: {what} ({where})") from error
