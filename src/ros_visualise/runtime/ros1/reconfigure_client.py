"""The live parameters of a node in another process, over dynamic_reconfigure."""

from __future__ import annotations

import ast
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache, partial
from typing import Any

import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import Config, ConfigDescription, Group, ParamDescription
from dynamic_reconfigure.srv import Reconfigure

from ros_visualise.core.errors import ParameterError, RosVisualiseError, Unreachable
from ros_visualise.core.params import Plain, Spec, Value, plain_of, specs
from ros_visualise.core.supervision import attempt
from ros_visualise.nodes import NodeType, SourceType
from ros_visualise.runtime.middleware import ParametersListener
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.remote.declaration import (
    ParameterDescription,
    declared,
    name_here,
    name_there,
)
from ros_visualise.runtime.ros1.errors import translated
from ros_visualise.runtime.ros1.reconfigure_server import describe

_TYPES: dict[str, type] = {"bool": bool, "int": int, "double": float, "str": str}
_MAX_INT = 2**31 - 1


@dataclass(frozen=True)
class Ros1Declaration:
    """A node's parameters here, and how they are written there.

    Attributes:
        params: the dataclass: that of our own node, if it is one of ours, else made for it.
        node: our own node, if it is one.
        choices: parameter -> the text of its choices -> what is sent for them.
    """

    params: type
    node: NodeType | SourceType | None = None
    choices: Mapping[str, Mapping[str, Plain]] = field(default_factory=dict)

    def decode(self, config: Config) -> dict[str, Any]:
        """The values in a message that fit the declaration."""
        sent: Mapping[str, Plain] = decode_config(config)
        return {
            spec.name: self._shown(spec.name, sent[name_there(spec.name)])
            for spec in specs(self.params)
            if name_there(spec.name) in sent
        }

    def encode(self, declared: Sequence[Spec], values: Mapping[str, Value]) -> Config:
        """A message that sets these values."""
        types = {spec.name: spec.type for spec in declared}
        return encode_config(
            {name_there(name): self._sent(name, types[name], v) for name, v in values.items()}
        )

    def _shown(self, name: str, value: Plain) -> Plain:
        choices = self.choices.get(name, {})
        return next((text for text, sent in choices.items() if sent == value), value)

    def _sent(self, name: str, kind: type, value: Value) -> Plain:
        if isinstance(value, Enum):
            text = str(plain_of(value))
            return self.choices.get(name, {}).get(text, text)
        converted: Plain = kind(value)
        return converted


def declare(description: ConfigDescription) -> Ros1Declaration:
    """The declaration for a description: our own, if it tells the same, else one made for it."""
    for ours, declaration in our_own():
        if ours == description:
            return declaration
    return _make(description)


@cache
def our_own() -> list[tuple[ConfigDescription, Ros1Declaration]]:
    """Our own nodes, each with its description; the first call takes a second of imports."""
    return [(describe(specs(kind)), Ros1Declaration(kind, node)) for kind, node in offered()]


def _make(description: ConfigDescription) -> Ros1Declaration:
    described = _declared(description)
    choices = {name_here(one.name): one.choices for one in described if one.is_choice}
    return Ros1Declaration(declared(described), choices=choices)


def _declared(description: ConfigDescription) -> list[ParameterDescription]:
    low, high, default = (
        decode_config(c) for c in (description.min, description.max, description.dflt)
    )
    return [
        ParameterDescription(
            described.name,
            _TYPES[described.type],
            default[described.name],
            described.description,
            *_limits(described.type, low[described.name], high[described.name]),
            group=group.name if group.id else "",
            choices=_choices(described),
        )
        for group, described in _parameters(description)
    ]


def _parameters(description: ConfigDescription) -> list[tuple[Group, ParamDescription]]:
    return [
        (group, described)
        for group in description.groups
        for described in group.parameters
        if described.type in _TYPES
    ]


def _choices(described: ParamDescription) -> dict[str, Plain]:
    """The constants that an ``edit_method`` lists: name -> value; empty without any."""
    try:
        listed = ast.literal_eval(described.edit_method)["enum"]
        return {str(constant["name"]): constant["value"] for constant in listed}
    except (SyntaxError, ValueError, KeyError, TypeError):
        return {}


def _limits(kind: str, low: Any, high: Any) -> tuple[float | None, float | None]:
    """The limits of a number; None for those that only say how far its type goes."""
    if kind not in ("int", "double"):
        return None, None
    far = _MAX_INT if kind == "int" else math.inf
    return (None if low <= -far else low), (None if high >= far else high)


class ReconfigureClient:
    """Follows a node's parameters; see `ros_visualise.runtime.middleware.ParametersClient`.

    Args:
        node: where dynamic_reconfigure has them, such as ``/edge_detector``.
        listener: receives them.
    """

    def __init__(self, node: str, listener: ParametersListener) -> None:
        our_own()  # is needed soon, by threads that must not wait for it
        self._node = node
        self._listener = listener
        self._declaration: Ros1Declaration | None = None
        self._description: ConfigDescription | None = None
        self._last: Config | None = None
        self._lock = threading.RLock()
        self._descriptions = rospy.Subscriber(
            f"{node}/parameter_descriptions", ConfigDescription, self._calling(self._described)
        )
        self._updates = rospy.Subscriber(
            f"{node}/parameter_updates", Config, self._calling(self._updated)
        )

    @property
    def connected(self) -> bool:
        """True while the node is connected."""
        return bool(self._updates.get_num_connections())

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over values.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """
        declaration = self._declaration
        if declaration is None:
            raise Unreachable("its parameters have not been received yet")
        config = declaration.encode(specs(declaration.params), values)
        try:
            with translated(self._node):
                service = rospy.ServiceProxy(f"{self._node}/set_parameters", Reconfigure)
                answer = service(config)
        except Unreachable:
            raise
        except RosVisualiseError as error:
            raise ParameterError(str(error)) from error
        return declaration.decode(answer.config)

    def close(self) -> None:
        """Follow them no longer."""
        self._descriptions.unregister()
        self._updates.unregister()

    def _calling(self, take: Callable[[Any], None]) -> Callable[[Any], object]:
        return lambda message: attempt(self._node, partial(take, message))

    def _described(self, description: ConfigDescription) -> None:
        with self._lock:
            if description == self._description:
                return
            self._description = description
            self._declaration = declare(description)
            self._listener.declared(self._declaration.params, self._declaration.node)
            if self._last is not None:
                self._updated(self._last)

    def _updated(self, config: Config) -> None:
        with self._lock:
            self._last = config
            if self._declaration is not None:
                self._listener.updated(self._declaration.decode(config))
