"""A node's declared parameters <-> ROS 2's descriptors and values."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from enum import Enum
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
)
from rclpy.parameter import Parameter

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import Spec, Value
from ros_visualise.runtime.bridge.parameter_values import read

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
    """What ROS 2 tells of a parameter: type, range, help, choices."""
    told = ParameterDescriptor(
        name=name,
        type=_TYPES[_kind(spec)],
        description=spec.help,
        additional_constraints=f"one of {', '.join(spec.choices)}" if spec.choices else "",
    )
    if spec.min is None and spec.max is None:
        return told
    if spec.type is int:
        low, high = _limits(spec, _MIN_INT, _MAX_INT)
        told.integer_range = [IntegerRange(from_value=int(low), to_value=int(high))]
    elif spec.type is float:
        low, high = _limits(spec, -_MAX_FLOAT, _MAX_FLOAT)
        told.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    return told


def limits(told: ParameterDescriptor) -> tuple[float | None, float | None]:
    """The limits of a number; None for those that only say how far its type goes."""
    for range_, far in ((told.integer_range, _MAX_INT), (told.floating_point_range, _MAX_FLOAT)):
        for one in range_:
            low, high = sorted((one.from_value, one.to_value))
            return (None if low <= -far else low), (None if high >= far else high)
    return None, None


def step(told: ParameterDescriptor) -> float | None:
    """From one value of a number to the next; None where any value will do."""
    return (
        next((one.step for one in (*told.integer_range, *told.floating_point_range)), None) or None
    )


def plain(spec: Spec, value: Value) -> bool | int | float | str:
    """A parameter's value as ROS 2 holds it: of an Enum that of its choice, of an int 64 bits."""
    kind, held = _kind(spec), value.value if isinstance(value, Enum) else value
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


def values_of(names: Iterable[str], told: Iterable[Any]) -> dict[str, Any]:
    """The values in rcl_interfaces/msg/ParameterValue messages, by their names; lists as text."""
    pairs = list(zip(names, told, strict=False))
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
