"""A node's declared parameters <-> ROS 2's descriptors and values."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
)
from rclpy.parameter import Parameter

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Spec, Value, plain_of, specs
from ros_visualise.nodes import NodeType, SourceType
from ros_visualise.runtime.bridge.parameter_values import read
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.remote.declaration import ParameterDescription, declared, name_here
from ros_visualise.runtime.ros2.session import OF_ROS

_MIN_INT, _MAX_INT = -(2**63), 2**63 - 1
_MAX_FLOAT = sys.float_info.max
_TYPES: dict[type, int] = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    float: ParameterType.PARAMETER_DOUBLE,
    str: ParameterType.PARAMETER_STRING,
}
_LISTS = {
    ParameterType.PARAMETER_BYTE_ARRAY: "byte_array_value",
    ParameterType.PARAMETER_BOOL_ARRAY: "bool_array_value",
    ParameterType.PARAMETER_INTEGER_ARRAY: "integer_array_value",
    ParameterType.PARAMETER_DOUBLE_ARRAY: "double_array_value",
    ParameterType.PARAMETER_STRING_ARRAY: "string_array_value",
}
_SHOWN = 200
"""Characters of a list that are shown."""

_FIELDS = {
    ParameterType.PARAMETER_BOOL: "bool_value",
    ParameterType.PARAMETER_INTEGER: "integer_value",
    ParameterType.PARAMETER_DOUBLE: "double_value",
    ParameterType.PARAMETER_STRING: "string_value",
}
KINDS = {number: kind for kind, number in _TYPES.items()}
"""The types of parameters that are read here: their number in ROS 2 -> Python's."""


def describe(spec: Spec, name: str) -> ParameterDescriptor:
    """ROS 2's description of a parameter: type, range, help, choices."""
    descriptor = ParameterDescriptor(
        name=name,
        type=_TYPES[_kind(spec)],
        description=spec.help,
        additional_constraints=f"one of {', '.join(spec.choices)}" if spec.choices else "",
    )
    if spec.min is None and spec.max is None:
        return descriptor
    if spec.type is int:
        low, high = _limits(spec, _MIN_INT, _MAX_INT)
        descriptor.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    elif spec.type is float:
        low, high = _limits(spec, -_MAX_FLOAT, _MAX_FLOAT)
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    return descriptor


def limits(descriptor: ParameterDescriptor) -> tuple[float | None, float | None]:
    """The limits of a number; None for those that only say how far its type goes."""
    for range_, far in (
        (descriptor.integer_range, _MAX_INT),
        (descriptor.floating_point_range, _MAX_FLOAT),
    ):
        for one in range_:
            low, high = sorted((one.from_value, one.to_value))
            return (None if low <= -far else low), (None if high >= far else high)
    return None, None


def step(descriptor: ParameterDescriptor) -> float | None:
    """The step of a number; None: any value."""
    ranges = *descriptor.integer_range, *descriptor.floating_point_range
    return next((one.step for one in ranges), None) or None


def plain(spec: Spec, value: Value) -> bool | int | float | str:
    """A parameter's value as ROS 2 holds it: of an Enum that of its choice, of an int 64 bits."""
    kind, held = _kind(spec), plain_of(value)
    if kind is int:
        return min(max(int(held), _MIN_INT), _MAX_INT)
    converted: bool | int | float | str = kind(held)
    return converted


def wanted(spec: Spec, value: Any) -> Any:
    """A value that is asked for, as ROS 2 holds it; as it is where it has to be refused."""
    try:
        return plain(spec, read(spec, value))
    except ParameterError:
        kind = _kind(spec)
        return kind(value) if kind is str or (kind is float and type(value) is int) else value


def to_parameters(prefix: str, declared: Iterable[Spec], params: Any) -> list[Parameter]:
    """The values of a params object, under names that begin so."""
    return [
        Parameter(prefix + spec.name, value=plain(spec, getattr(params, spec.name)))
        for spec in declared
    ]


def values_of(names: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
    """The values in rcl_interfaces/msg/ParameterValue messages, by their names; lists as text."""
    pairs = list(zip(names, values, strict=False))
    single = {n: getattr(one, _FIELDS[one.type]) for n, one in pairs if one.type in _FIELDS}
    lists = {n: list(getattr(one, _LISTS[one.type])) for n, one in pairs if one.type in _LISTS}
    return single | {name: _text(values) for name, values in lists.items()}


def _text(values: list[Any]) -> str:
    text = str(values)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]} ... ({len(values)} values)"


def _kind(spec: Spec) -> type:
    """The type as which ROS 2 holds a parameter.

    Choices that are numbers are numbers there: ``ros2 param set`` takes all that looks like one
    for a number.
    """
    if not issubclass(spec.type, Enum):
        return spec.type
    return int if all(isinstance(one.value, int) for one in spec.type) else str


def _limits(spec: Spec, low: float, high: float) -> tuple[float, float]:
    return (low if spec.min is None else spec.min), (high if spec.max is None else spec.max)


_NO_NAME = re.compile(r"\W")


@dataclass(frozen=True)
class Ros2Declaration:
    """A node's parameters here, and how they are called there.

    Attributes:
        params: the dataclass: that of our own node, if it is one of ours, else made for it.
        node: our own node, if it is one.
        names: of a field -> of the parameter.
    """

    params: type
    node: NodeType | SourceType | None
    names: Mapping[str, str]

    def decode(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The values of parameters, by the fields' names."""
        return {here: values[there] for here, there in self.names.items() if there in values}

    def encode(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Fields' values, by the parameters' names."""
        known = {spec.name: spec for spec in specs(self.params)}
        return {self.names[here]: plain(known[here], value) for here, value in values.items()}


def declare(
    descriptors: Sequence[ParameterDescriptor], values: Mapping[str, Any], prefix: str
) -> Ros2Declaration:
    """The declaration for descriptors: our own, if they tell the same, else one made for them.

    Args:
        descriptors: of all parameters of a ROS 2 node.
        values: parameter -> its value now.
        prefix: what the names begin with of those that are meant.
    """
    mine = [one for one in descriptors if _is_meant(one, prefix) and one.name in values]
    key = frozenset(_identity(one, prefix) for one in mine if not _is_fixed(one))
    if key in our_own():
        params, node = our_own()[key]
        return Ros2Declaration(params, node, {s.name: prefix + s.name for s in specs(params)})
    names = _fields([one.name for one in mine], prefix)
    by_name = {one.name: one for one in mine}
    made = [_made(field, by_name[n], values[n], prefix) for field, n in names.items()]
    return Ros2Declaration(declared(made), None, names)


@cache
def our_own() -> dict[frozenset[Any], tuple[type, NodeType | SourceType]]:
    """Our own nodes, by what they tell; the first call takes a second of imports."""
    return {
        frozenset(_identity(describe(spec, spec.name), "") for spec in specs(kind)): (kind, node)
        for kind, node in offered()
    }


def _is_meant(descriptor: ParameterDescriptor, prefix: str) -> bool:
    return descriptor.name.startswith(prefix) and not descriptor.name.startswith(OF_ROS)


def _is_fixed(descriptor: ParameterDescriptor) -> bool:
    """True if it cannot be set."""
    return bool(descriptor.read_only) or descriptor.type not in KINDS


def _identity(descriptor: ParameterDescriptor, prefix: str) -> Any:
    text = descriptor.description, descriptor.additional_constraints
    return descriptor.name.removeprefix(prefix), descriptor.type, *text, limits(descriptor)


def _fields(names: Iterable[str], prefix: str) -> dict[str, str]:
    """Names that fields can have -> those of parameters, which have dots and hyphens in them."""
    fields: dict[str, str] = {}
    for name in names:
        text = _NO_NAME.sub("_", name.removeprefix(prefix))
        field = name_here(text if text.isidentifier() else f"_{text}")
        while field in fields:
            field += "_"
        fields[field] = name
    return fields


def _made(
    field: str, descriptor: ParameterDescriptor, value: Any, prefix: str
) -> ParameterDescription:
    low, high = limits(descriptor)
    name = descriptor.name.removeprefix(prefix)
    return ParameterDescription(
        field,
        KINDS.get(descriptor.type, str),
        value,
        descriptor.description or name,
        low,
        high,
        group=name.rpartition(".")[0],
        step=step(descriptor),
        label=name if name != field else "",
        read_only=_is_fixed(descriptor),
    )
