"""Changes of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, ClassVar

import numpy as np

from ros_visualise.core.message import Message
from ros_visualise.core.params import Value
from ros_visualise.data.fields import Fields, read_time, time
from ros_visualise.data.header import Header

_FIELDS: dict[type, tuple[int, str]] = {
    bool: (1, "bool_value"),
    int: (2, "integer_value"),
    float: (3, "double_value"),
    str: (4, "string_value"),
}
"""Type of a value -> its number in rcl_interfaces/msg/ParameterType, and its field."""


@dataclass(frozen=True)
class ParameterEvent(Message):
    """Parameters of one node: ``new`` when it starts, ``changed`` later."""

    type_name: ClassVar[str] = "rcl_interfaces/msg/ParameterEvent"

    node: str
    new: Mapping[str, Value] = field(default_factory=dict)
    changed: Mapping[str, Value] = field(default_factory=dict)
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        return {
            "stamp": time(self.header.stamp_ns),
            "node": f"/{self.node}",
            "new_parameters": [_parameter(*item) for item in self.new.items()],
            "changed_parameters": [_parameter(*item) for item in self.changed.items()],
            "deleted_parameters": [],
        }

    @classmethod
    def read(cls, message: Any) -> ParameterEvent:
        return cls(
            node=str(message.node).removeprefix("/"),
            new={p.name: _read_value(p) for p in message.new_parameters},
            changed={p.name: _read_value(p) for p in message.changed_parameters},
            header=Header(read_time(message.stamp)),
        )


def _parameter(name: str, value: Value) -> Fields:
    plain = value.value if isinstance(value, Enum) else value
    number, field = _FIELDS[type(plain)]
    values: dict[str, Any] = {unset: cls() for cls, (_, unset) in _FIELDS.items()}
    values |= {
        "byte_array_value": np.zeros(0, np.uint8),
        "bool_array_value": np.zeros(0, np.bool_),
        "integer_array_value": np.zeros(0, np.int64),
        "double_array_value": np.zeros(0, np.float64),
        "string_array_value": [],
    }
    stored = Fields("rcl_interfaces/msg/ParameterValue", values | {"type": number, field: plain})
    return Fields("rcl_interfaces/msg/Parameter", {"name": name, "value": stored})


def _read_value(parameter: Any) -> Value:
    for cls, (number, name) in _FIELDS.items():
        if parameter.value.type == number:
            value: Value = cls(getattr(parameter.value, name))
            return value
    raise ValueError(f"parameter {parameter.name}: only bool, integer, double and string are read")
