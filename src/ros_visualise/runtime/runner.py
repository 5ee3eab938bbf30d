"""Runs one node's steps, whichever runtime brings the messages."""

from __future__ import annotations

import logging
import threading
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ros_visualise.core.errors import DamagedMessage, NoTransform, RosVisualiseError
from ros_visualise.core.params import Parameters
from ros_visualise.data import Image, Transforms
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.graph import Node
from ros_visualise.messages.recorded import content
from ros_visualise.runtime.queues import Packet
from ros_visualise.runtime.refusals import require_header
from ros_visualise.runtime.report import NodeReport
from ros_visualise.runtime.stats import NodeStats

log = logging.getLogger(__name__)

NOTHING: Mapping[str, Any] = {}
"""A node's answer when it has nothing for this message."""

_ERRORS = (Exception, SystemExit)  # exit() would end the node's thread alone, without a word
T = TypeVar("T")

_PATIENCE_S = 0.2  # of who asks for figures, with a step that takes long


class NodeRunner:
    """One node at work: its state, its live parameters, its counts, and the frames that it knows.

    An error in a step costs that one message, which is counted as dropped under ``error``; errors
    elsewhere, as in ``tick`` or ``finish``, are counted by themselves. Each is logged once for the
    place in the code where it comes from, and ``failed`` stays set.

    Raises:
        RosVisualiseError: the node cannot begin.
    """

    def __init__(self, node: Node, parameters: Parameters[Any]) -> None:
        self.node = node
        self.stats = NodeStats()
        self.frames = FrameTree()
        self.told: set[str] = set()  # frames that the node itself tells of: it waits for none
        self.failed = False
        self.stateless = node.type.stateless
        self._type = node.type
        self._parameters = parameters
        self._state = begun(node.name, lambda: node.type.make(parameters.current))
        self._epoch: int | None = None  # of the last message
        self._said: set[tuple[str, type, str, int | None]] = set()
        self._uncalibrated: set[str] = set()  # inputs of which it was said
        self._figures: dict[str, Any] = {}  # of its own
        self._at_state = threading.Lock()

    def step(self, *packets: Packet) -> Mapping[str, Any]:
        """What the node makes of a message, or of those of several inputs that belong together.

        The answer is output name -> message.
        """
        started_ns = time.monotonic_ns()
        packet = max(packets, key=lambda one: (one.epoch, one.arrival_ns))
        if self._is_of_before(packet):
            self.stats.dropped["stale"] += 1
            return NOTHING
        try:
            messages = {one.port: self._content(one) for one in packets}
            if self._type.calibrated:
                self._tell_if_uncalibrated(messages)
            with self._at_state:
                self._reset_if_time_jumped(packet)
                given = self._by_output(self._ask(packet, messages))
            outputs = self._passing(given)
        except DamagedMessage:
            self.stats.dropped["damaged"] += 1
            return NOTHING
        except NoTransform as error:
            self.stats.dropped["no transform"] += 1
            self._say(error)
            return NOTHING
        except _ERRORS as error:
            self.stats.dropped["error"] += 1
            self._fail(error)
            return NOTHING
        if len(outputs) < len(given):
            self.stats.dropped["error"] += 1
        elif not outputs and self._type.drops:
            self.stats.dropped[self._type.drops] += 1
        else:
            self.stats.answered(packet.arrival_ns, started_ns)
        return outputs

    def act(self, name: str) -> Mapping[str, Any]:
        """Run an action; what the node answers to it.

        Raises:
            RosVisualiseError: it failed.
        """
        try:
            return self._ask_between_steps(getattr(self._state, name))
        except RosVisualiseError:
            raise
        except _ERRORS as error:
            what = f"{type(error).__name__}: {error}"
            raise RosVisualiseError(f"{self.node.name}: {name} failed: {what}") from error

    def tick(self) -> Mapping[str, Any]:
        """What is due although no message came."""
        return self._answer(lambda: self._state.tick(self._parameters.current))

    def finish(self) -> Mapping[str, Any]:
        """What the node still has at the end of the stream."""
        return self._answer(self._state.finish)

    def report(self) -> NodeReport:
        """Counts and latencies, and the node's own figures; in a long step those of before it."""
        if self._at_state.acquire(timeout=_PATIENCE_S):
            try:
                self._figures = self._state.report()
            except _ERRORS as error:
                self._figures = {}
                self.stats.errors += 1
                self._fail(error)
            finally:
                self._at_state.release()
        return replace(self.stats.report(), own=self._figures, gate=self._type.drops)

    def _answer(self, ask: Callable[[], Any]) -> Mapping[str, Any]:
        """What the node says between two steps; nothing where that fails."""
        try:
            return self._ask_between_steps(ask)
        except _ERRORS:
            return NOTHING

    def _ask_between_steps(self, ask: Callable[[], Any]) -> Mapping[str, Any]:
        try:
            with self._at_state:
                given = self._by_output(ask())
                outputs = self._passing(given)
        except _ERRORS as error:
            self.stats.errors += 1
            self._fail(error)
            raise
        self.stats.errors += len(given) - len(outputs)
        return outputs

    def _content(self, packet: Packet) -> Any:
        try:
            return content(packet.message)
        except DamagedMessage as error:
            self._say(error, self.node.inputs[packet.port])
            raise

    def _tell_if_uncalibrated(self, messages: Mapping[str, Any]) -> None:
        """Say once of an input that its images have no calibration; the node goes on without."""
        for port, message in messages.items():
            is_new = port not in self._uncalibrated
            if is_new and isinstance(message, Image) and message.camera_info is None:
                self._uncalibrated.add(port)
                what = "%s: the images on %s come without a calibration (said once)"
                log.warning(what, self.node.name, self.node.inputs[port])

    def _ask(self, packet: Packet, messages: Mapping[str, Any]) -> Any:
        given = {**messages, "params": self._parameters.current}
        if self._type.timed:
            given["arrival_ns"] = packet.log_ns or packet.arrival_ns
        if self._type.frames:
            given["frames"] = self.frames
        return self._state.step(**given)

    def _by_output(self, answer: Any) -> Mapping[str, Any]:
        """The messages of an answer by their outputs; None where there is none for an output."""
        if answer is None:
            return NOTHING
        return answer if isinstance(answer, dict) else {next(iter(self._type.outputs), ""): answer}

    def _passing(self, given: Mapping[str, Any]) -> Mapping[str, Any]:
        """Those messages of an answer that are what is declared; the others are refused."""
        return {name: message for name, message in given.items() if self._passes(name, message)}

    def _passes(self, name: str, message: Any) -> bool:
        try:
            if message is not None:
                self._require(name, message)
        except _ERRORS as error:
            self._fail(error, name)
            return False
        return True

    def _require(self, name: str, message: Any) -> None:
        """See that a message can go on.

        Raises:
            DamagedMessage: it is not what is declared.
        """
        declared = self._type.outputs
        if name not in declared or not isinstance(message, declared[name]):
            wanted = ", ".join(f"{port}: {kind.__name__}" for port, kind in declared.items())
            given = f"{name or 'something'}: {type(message).__name__}"
            raise DamagedMessage(f"answers with {given}, but declares {wanted or 'nothing'}")
        require_header(message)
        if isinstance(message, Transforms):
            self.told.update(one.child_frame_id for one in message.transforms)

    def _is_of_before(self, packet: Packet) -> bool:
        """Whether time has jumped since, as what came by another way has told already."""
        return self._epoch is not None and packet.epoch < self._epoch

    def _reset_if_time_jumped(self, packet: Packet) -> None:
        if self._epoch not in (None, packet.epoch):
            self._state.reset()
        self._epoch = packet.epoch

    def _fail(self, error: BaseException, topic: str = "") -> None:
        self.failed = True
        self._say(error, topic)

    def _say(self, error: BaseException, topic: str = "") -> None:
        origin = traceback.extract_tb(error.__traceback__)[-1]
        kind = (topic, type(error), origin.filename, origin.lineno)
        if kind not in self._said:
            self._said.add(kind)
            bug = not isinstance(error, RosVisualiseError)
            where = f"{self.node.name}: {topic}" if topic else self.node.name
            what = f"{kind[1].__name__}: {error}" if bug else error
            log.error(
                "%s: %s (further occurrences suppressed)",
                where,
                what,
                exc_info=error if bug else None,
            )


def begun(name: str, make: Callable[[], T]) -> T:
    """What ``make`` makes: the state of a node or a source of this name, which begins.

    Raises:
        RosVisualiseError: it cannot.
    """
    try:
        return make()
    except RosVisualiseError:
        raise
    except _ERRORS as error:
        origin = traceback.extract_tb(error.__traceback__)[-1]
        what = f"{type(error).__name__}: {error}".removesuffix(": ")
        where = f"{origin.filename}, line {origin.lineno}"
        raise RosVisualiseError(f"{name} cannot begin: {what} ({where})") from error
