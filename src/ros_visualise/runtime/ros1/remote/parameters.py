"""The live parameters of a node in another process, over dynamic_reconfigure."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any

import rospy
from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure

from ros_visualise import params
from ros_visualise.errors import OpenError, ParameterError
from ros_visualise.nodes import NoParams
from ros_visualise.params import Parameters, specs
from ros_visualise.runtime.ros1.remote.declaration import Declaration, declare

log = logging.getLogger(__name__)

_ANSWER_S = 2.0
"""A node that takes longer to answer counts as gone."""
_GONE_S = 2.0
_ECHO_S = 0.25
_REFUSED = "responded with an error"  # rospy has one exception for this and for no answer at all
_UNKNOWN = Declaration(NoParams)


class RemoteParameters(Parameters[Any]):
    """A node's parameters, whoever changes them.

    ``current`` has no fields until the node has told of its parameters (see `wait`). When the node
    comes back after its end, so do they.

    Args:
        node: where dynamic_reconfigure has them, such as ``/edge_detector``.
    """

    def __init__(self, node: str) -> None:
        super().__init__(NoParams())
        self.declaration = _UNKNOWN
        self._node = node
        self._name = node.removeprefix("/")
        self._last: Config | None = None
        self._ready = threading.Event()
        self._came = threading.Condition()
        self._count = 0
        self._recent: deque[tuple[int, Mapping[str, Any]]] = deque(maxlen=64)
        self._seen_s = time.monotonic()
        self._is_missed = False
        self._description: ConfigDescription | None = None
        self._calls = threading.Lock()
        self._calling: threading.Thread | None = None
        self._refused: set[str] = set()
        self._descriptions = rospy.Subscriber(
            f"{node}/parameter_descriptions", ConfigDescription, self._described
        )
        self._updates = rospy.Subscriber(f"{node}/parameter_updates", Config, self._updated)

    def wait(self, timeout_s: float) -> bool:
        """Wait until the node has told of its parameters; whether it has."""
        return self._ready.wait(timeout_s)

    @property
    def is_there(self) -> bool:
        """Whether the node is connected."""
        return bool(self._updates.get_num_connections())

    def follow(self) -> None:
        """Say, once, that the node has gone or is back; to be called while the master is there.

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
            ParameterError: as `ros_visualise.params.update`, or the node itself refuses.
            OpenError: the node does not answer.
        """
        if not self.wait(_ANSWER_S):
            raise self._no_answer()
        wanted = params.update(self.current, changes)
        values = {name: getattr(wanted, name) for name in changes}
        with self._came:
            asked = self._count
        answer = self.declaration.decode(self._call(values))
        with self._came:
            self._came.wait_for(lambda: self._has_come(asked, answer), _ECHO_S)
            overtaken = self._count > asked
        if not overtaken:
            self._apply(answer)
        return self.current

    def close(self) -> None:
        """Follow it no longer."""
        self._descriptions.unregister()
        self._updates.unregister()

    def _call(self, values: Mapping[str, Any]) -> Config:
        """Ask the node to set values; its answer, or an error in bounded time."""
        config = self.declaration.encode(specs(self.current), values)
        answers: list[Config | ParameterError] = []
        if self._calls.acquire(timeout=_ANSWER_S):
            try:
                self._ask_aside(config, answers)
            finally:
                self._calls.release()
        if not answers:
            raise self._no_answer()
        if isinstance(answers[0], ParameterError):
            raise answers[0]
        return answers[0]

    def _no_answer(self) -> OpenError:
        return OpenError(f"{self._name} does not answer; is it still running?")

    def _ask_aside(self, config: Config, answers: list[Config | ParameterError]) -> None:
        """Ask on a thread that is left behind when no answer comes."""
        if self._calling is None or not self._calling.is_alive():
            self._calling = threading.Thread(target=self._ask, args=(config, answers), daemon=True)
            self._calling.start()
            self._calling.join(_ANSWER_S)

    def _ask(self, config: Config, answers: list[Config | ParameterError]) -> None:
        try:
            service = rospy.ServiceProxy(f"{self._node}/set_parameters", Reconfigure)
            answers.append(service(config).config)
        except (rospy.ServiceException, rospy.ROSException, OSError) as error:
            if _REFUSED in str(error):
                answers.append(ParameterError(f"{self._name} refuses: {error}"))
            log.debug("%s: %s", self._name, error)

    def _has_come(self, asked: int, answer: Mapping[str, Any]) -> bool:
        return any(number > asked and values == answer for number, values in self._recent)

    def _described(self, description: ConfigDescription) -> None:
        with self._lock:
            if description == self._description:
                return
            self._description = description
            self.declaration = declare(description)
            self.current = self.declaration.params()
            if self._last is not None:
                self._updated(self._last)

    def _updated(self, config: Config) -> None:
        with self._lock:
            self._last = config
            if self.declaration is _UNKNOWN:
                return
            values = self.declaration.decode(config)
            self._apply(values)
        with self._came:
            self._count += 1
            self._recent.append((self._count, values))
            self._came.notify_all()
        self._ready.set()

    def _apply(self, values: Mapping[str, Any]) -> None:
        """Take over what the node has, but for what contradicts its own description."""
        fitting = {}
        for spec in specs(self.current):
            if spec.name in values:
                try:
                    fitting[spec.name] = spec.coerce(values[spec.name])
                except ParameterError as error:
                    self._say_refused(spec.name, error)
        super().update(fitting)

    def _say_refused(self, name: str, error: ParameterError) -> None:
        if name not in self._refused:
            self._refused.add(name)
            log.warning("%s has a value that it declares impossible: %s", self._name, error)
