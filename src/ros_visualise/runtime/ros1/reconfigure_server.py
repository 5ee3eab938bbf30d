"""A node's live parameters on a ROS graph: dynamic_reconfigure, and their starting values."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import Any

import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import (
    Config,
    ConfigDescription,
    Group,
    GroupState,
    ParamDescription,
)
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest, ReconfigureResponse

from ros_visualise.core import supervision
from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Parameters, Plain, Spec, Value, plain_of, specs
from ros_visualise.runtime.bridge.parameter_values import given_values, spelled
from ros_visualise.runtime.ros1.errors import MASTER, translated
from ros_visualise.runtime.ros1.registration import set_param

_MIN_INT, _MAX_INT = -(2**31), 2**31 - 1
_RESTART = 1
"""The level of a parameter that reopens the source; the others have 0."""
_TYPES = {bool: "bool", int: "int", float: "double", str: "str"}
_WIDEST: dict[type, tuple[float, float]] = {
    int: (_MIN_INT, _MAX_INT),
    float: (-math.inf, math.inf),
}


def describe(declared: Sequence[Spec]) -> ConfigDescription:
    """dynamic_reconfigure's description of parameters: types, ranges, help, choices, groups."""
    limits = {spec.name: _limits(spec) for spec in declared}
    groups = [Group(name="Default", id=0, parent=0)]
    groups += [Group(name=name, id=n + 1, parent=0) for n, name in enumerate(_groups(declared))]
    by_name = {"": groups[0]} | {group.name: group for group in groups[1:]}
    for spec in declared:
        by_name[spec.group].parameters.append(_describe_one(spec))
    return ConfigDescription(
        groups=groups,
        min=encode_config({name: low for name, (low, _) in limits.items()}),
        max=encode_config({name: high for name, (_, high) in limits.items()}),
        dflt=encode_config({spec.name: plain(spec, spec.default) for spec in declared}),
    )


def to_config(declared: Sequence[Spec], params: Any) -> Config:
    """The values of a params object as a message."""
    values = {spec.name: plain(spec, getattr(params, spec.name)) for spec in declared}
    config = encode_config(values)
    config.groups = [GroupState("Default", True, 0, 0)]
    config.groups += [GroupState(n, True, i + 1, 0) for i, n in enumerate(_groups(declared))]
    return config


def from_config(declared: Sequence[Spec], config: Config) -> dict[str, Any]:
    """The values that a message holds, with the words back that YAML takes for a bool."""
    values: Mapping[str, Plain] = decode_config(config)
    known = {spec.name: spec for spec in declared}
    return {n: spelled(known[n], v) if n in known else v for n, v in values.items()}


def plain(spec: Spec, value: Value) -> Plain:
    """A parameter's value as ROS holds it: of an Enum its text, of an int 32 bits."""
    if isinstance(value, Enum):
        return plain_of(value)
    if spec.type is int:
        return min(max(int(value), _MIN_INT), _MAX_INT)
    converted: Plain = spec.type(value)
    return converted


def _groups(declared: Sequence[Spec]) -> list[str]:
    return list(dict.fromkeys(spec.group for spec in declared if spec.group))


def _limits(spec: Spec) -> tuple[Plain, Plain]:
    if spec.type is bool:
        return False, True
    if spec.type not in _WIDEST:
        return "", ""
    low, high = _WIDEST[spec.type]
    low, high = (low if spec.min is None else spec.min), (high if spec.max is None else spec.max)
    return plain(spec, low), plain(spec, high)


def _describe_one(spec: Spec) -> ParamDescription:
    return ParamDescription(
        name=spec.name,
        type=_TYPES.get(spec.type, "str"),
        level=_RESTART if spec.restart else 0,
        description=spec.help,
        edit_method=repr(_choices(spec)) if spec.choices else "",
    )


def _choices(spec: Spec) -> dict[str, Any]:
    constants = [
        {"name": choice, "type": "str", "value": choice, "description": ""}
        for choice in spec.choices
    ]
    return {"enum": constants, "enum_description": spec.help}


log = logging.getLogger(__name__)

_CLOSE_S = _AGAIN_S = 0.5
_OF_ALL = ("end_with_master",)
"""Other private parameters that every node has here."""


class ReconfigureServer:
    """Offers a node's parameters over dynamic_reconfigure, for as long as it is open.

    Requests are answered before the parameters are published.
    A request is applied as one whole or refused as one whole; what is changed elsewhere is
    published, and put on the parameter server, by a thread of its own: no lock is held by a
    thread that changes a parameter while ROS is talked to.

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
                log.warning("%s: %s=%s out of range; limited to %s", where, name, value, limit)
        return values

    def _follow(self) -> None:
        while not self._closed:
            self._changed.wait()
            self._changed.clear()
            if self._published != self._parameters.current and not self._closed:
                self._publish()

    def _publish(self) -> Config:
        """Publish the values as they are now; the last call publishes the last ones."""
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
