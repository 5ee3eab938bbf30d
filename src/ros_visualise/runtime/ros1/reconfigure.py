"""A node's live parameters on a ROS graph: dynamic_reconfigure, and what they start with."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterable, Mapping
from typing import Any

import rospy
from dynamic_reconfigure.msg import Config, ConfigDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest, ReconfigureResponse

from ros_visualise.core import supervision
from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, specs
from ros_visualise.runtime.bridge.parameter_values import given_values
from ros_visualise.runtime.ros1.description import describe, from_config, plain, to_config
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.registration import set_param

log = logging.getLogger(__name__)

_CLOSE_S = _AGAIN_S = 0.5
_OF_ALL = ("end_with_master",)
"""Other private parameters that every node has here."""


class ReconfigureServer:
    """Offers a node's parameters over dynamic_reconfigure, for as long as it is open.

    Requests are answered before anybody is told of the parameters.
    A request is applied as one whole or refused as one whole; what is changed elsewhere is
    published, and put on the parameter server, by a thread of its own: no lock is held by whoever
    changes a parameter while ROS is talked to.

    Args:
        parameters: what is offered.
        namespace: below the node's private one, for several nodes in one process.
    """

    def __init__(self, parameters: Parameters[Any], namespace: str = "") -> None:
        self._parameters = parameters
        self._specs = specs(parameters.current)
        self._namespace = _private(namespace)
        self._published: Any = None
        self._publishing = threading.Lock()
        self._changed = threading.Event()
        self._closed = False
        self._descriptions = self._advertise("parameter_descriptions", ConfigDescription)
        self._updates = self._advertise("parameter_updates", Config)
        self._service = rospy.Service(f"{self._namespace}/set_parameters", Reconfigure, self._set)
        self._descriptions.publish(describe(self._specs))
        self._forget = parameters.on_change(lambda *_: self._changed.set())
        self._publish()
        self._thread = supervision.start("reconfigure", self._follow, again_s=_AGAIN_S)

    def close(self) -> None:
        """Offer them no longer; more than once does no harm."""
        if self._closed:
            return
        self._closed = True
        self._forget()
        self._changed.set()
        self._service.shutdown()
        self._thread.join(_CLOSE_S)
        with self._publishing:
            self._updates.unregister()
            self._descriptions.unregister()

    def _advertise(self, name: str, message_class: type) -> rospy.Publisher:
        return rospy.Publisher(f"{self._namespace}/{name}", message_class, latch=True, queue_size=1)

    def _set(self, request: ReconfigureRequest) -> ReconfigureResponse:
        """Answer a request with the values that hold after it, or with what is wrong about it.

        Raises:
            rospy.ServiceException: it is refused; dynparam then ends with these words.
        """
        try:
            asked = from_config(self._specs, request.config)
            self._parameters.update(self._clamped(asked))
        except ParameterError as error:
            log.warning("%s: %s", self._namespace.removeprefix("/"), error)
            raise rospy.ServiceException(str(error)) from error
        return ReconfigureResponse(self._publish())

    def _clamped(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        """The values within their limits, as every server of dynamic_reconfigure has it."""
        numbers = {spec.name: spec for spec in self._specs if spec.type in (int, float)}
        values = dict(asked)
        for name, value in asked.items():
            if name not in numbers or isinstance(value, bool | str):
                continue
            limit = numbers[name].clamp(value)
            if value < limit or value > limit:  # as NaN is not
                values[name] = limit
                where = self._namespace.removeprefix("/")
                log.warning("%s: %s=%s is beyond its limit: %s", where, name, value, limit)
        return values

    def _follow(self) -> None:
        while not self._closed:
            self._changed.wait()
            self._changed.clear()
            if self._published != self._parameters.current and not self._closed:
                self._publish()

    def _publish(self) -> Config:
        """Publish the values as they are now; whoever comes last publishes the last ones."""
        with self._publishing:
            current = self._parameters.current
            config = to_config(self._specs, current)
            self._put(current)
            self._published = current
            if not self._closed:
                self._updates.publish(config)
            return config

    def _put(self, current: Any) -> None:
        """Put what has changed on the parameter server, where the next start finds it.

        But for what is played, and how: a recording that had ended would start paused.
        """
        for spec in (one for one in self._specs if one.saved):
            value = getattr(current, spec.name)
            if self._published is None or value != getattr(self._published, spec.name):
                set_param(f"{self._namespace}/{spec.name}", plain(spec, value))


def starting_values(
    params_class: type, namespace: str = "", known: Iterable[str] = ()
) -> dict[str, Any]:
    """The values that launch files, ``_low:=3`` and YAML files gave to declared parameters.

    Args:
        params_class: the declared parameters.
        namespace: below the node's private one.
        known: other names that may stand there.

    Raises:
        ParameterError: a value is of the wrong type or out of its range.
    """
    with translated(MASTER):
        there = rospy.get_param(_private(namespace), {})
    given: Mapping[str, Any] = there if isinstance(there, dict) else {}
    where = f"~{namespace}/" if namespace else "~"
    return given_values(params_class, given, (*known, *_OF_ALL), where)


def _private(namespace: str) -> str:
    name: str = rospy.get_name()
    return f"{name}/{namespace}" if namespace else name
