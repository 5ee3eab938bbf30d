"""What dynamic_reconfigure tells of a node elsewhere -> a declaration of its parameters."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import Any

from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import Config, ConfigDescription, Group, ParamDescription

from ros_visualise.core.params import Spec, Value, specs
from ros_visualise.nodes import NodeType, SourceType
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.remote.declaration import (
    ParameterDescription,
    declared,
    name_here,
    name_there,
)
from ros_visualise.runtime.ros1.description import Plain, describe

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
            text = str(value.value)
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
    told = _told(description)
    choices = {name_here(one.name): one.choices for one in told if one.is_choice}
    return Ros1Declaration(declared(told), choices=choices)


def _told(description: ConfigDescription) -> list[ParameterDescription]:
    low, high, default = (
        decode_config(c) for c in (description.min, description.max, description.dflt)
    )
    return [
        ParameterDescription(
            told.name,
            _TYPES[told.type],
            default[told.name],
            told.description,
            *_limits(told.type, low[told.name], high[told.name]),
            group=group.name if group.id else "",
            choices=_choices(told),
        )
        for group, told in _parameters(description)
    ]


def _parameters(description: ConfigDescription) -> list[tuple[Group, ParamDescription]]:
    return [
        (group, told)
        for group in description.groups
        for told in group.parameters
        if told.type in _TYPES
    ]


def _choices(told: ParamDescription) -> dict[str, Plain]:
    """The constants that an ``edit_method`` lists: name -> value; empty where there are none."""
    try:
        listed = ast.literal_eval(told.edit_method)["enum"]
        return {str(constant["name"]): constant["value"] for constant in listed}
    except (SyntaxError, ValueError, KeyError, TypeError):
        return {}


def _limits(kind: str, low: Any, high: Any) -> tuple[float | None, float | None]:
    """The limits of a number; None for those that only say how far its type goes."""
    if kind not in ("int", "double"):
        return None, None
    far = _MAX_INT if kind == "int" else math.inf
    return (None if low <= -far else low), (None if high >= far else high)
