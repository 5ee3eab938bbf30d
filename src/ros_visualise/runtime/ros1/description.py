"""A node's declared parameters <-> what dynamic_reconfigure tells of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Any

from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import (
    Config,
    ConfigDescription,
    Group,
    GroupState,
    ParamDescription,
)

from ros_visualise.core.params import Spec, Value
from ros_visualise.runtime.bridge.parameter_values import spelled

Plain = bool | int | float | str

_MIN_INT, _MAX_INT = -(2**31), 2**31 - 1
_RESTART = 1
"""The level of a parameter that reopens the source; the others have 0."""
_TYPES = {bool: "bool", int: "int", float: "double", str: "str"}
_WIDEST: dict[type, tuple[float, float]] = {
    int: (_MIN_INT, _MAX_INT),
    float: (-math.inf, math.inf),
}


def describe(declared: Sequence[Spec]) -> ConfigDescription:
    """What dynamic_reconfigure says of these parameters: types, ranges, help, choices, groups."""
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
        return str(value.value)
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
