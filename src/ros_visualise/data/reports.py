"""Reports of nodes: log, diagnostics and parameters."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from typing import Any

import numpy as np

from ros_visualise.core.message import Message
from ros_visualise.core.params import Value
from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields, header, read_header, read_time, time
from ros_visualise.data.header import Header
from ros_visualise.data.ros_fields import TabledMessage

_LEVELS = {
    1: logging.DEBUG,
    2: logging.INFO,
    4: logging.WARNING,
    8: logging.ERROR,
    16: logging.CRITICAL,
}
"""Levels of ROS 1 -> those of Python, which ROS 2 has too."""


@dataclass(frozen=True)
class Log(Message, known=False):
    """One line of a node's log, in ROS 2; ``level`` is one of Python's logging."""

    type_name = "rcl_interfaces/msg/Log"
    plotted = False

    node: str
    level: int
    text: str
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        return {"stamp": time(self.header.stamp_ns), "level": self.level, **self._text_fields()}

    @classmethod
    def read(cls, message: Any) -> Log:
        stamp = Header(read_time(message.stamp))
        return cls(str(message.name), int(message.level), str(message.msg), stamp)

    def _text_fields(self) -> dict[str, Any]:
        said = {"name": self.node, "msg": self.text}
        return {**said, "file": "", "function": "", "line": 0}


@dataclass(frozen=True)
class Ros1Log(Log, known=False):
    """The same in ROS 1."""

    type_name = "rosgraph_msgs/msg/Log"

    def fields(self) -> dict[str, Any]:
        level = next(theirs for theirs, ours in _LEVELS.items() if ours >= self.level)
        return {"header": header(self.header), "level": level, "topics": [], **self._text_fields()}

    @classmethod
    def read(cls, message: Any) -> Ros1Log:
        level = _LEVELS.get(int(message.level), logging.INFO)
        return cls(str(message.name), level, str(message.msg), read_header(message.header))


class Level(IntEnum):
    """Severity, as numbered by diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class DiagnosticStatus:
    """The state of one part of a robot: a sentence, and values by name."""

    type_name = "diagnostic_msgs/msg/DiagnosticStatus"

    name: str
    level: Level = Level.OK
    message: str = ""
    values: Mapping[str, str] = field(default_factory=dict)

    def fields(self) -> dict[str, Any]:
        """The fields of the ROS message."""
        values = [
            Fields("diagnostic_msgs/msg/KeyValue", {"key": key, "value": value})
            for key, value in self.values.items()
        ]
        return {
            "level": int(self.level),
            "name": self.name,
            "message": self.message,
            "hardware_id": "",
            "values": values,
        }

    @classmethod
    def read(cls, message: Any) -> DiagnosticStatus:
        """The state in a ROS message.

        Raises:
            ValueError: unknown level.
        """
        level = message.level[0] if isinstance(message.level, bytes) else message.level
        values = {str(value.key): str(value.value) for value in message.values}
        return cls(str(message.name), Level(level), str(message.message), values)


@dataclass(frozen=True)
class DiagnosticArray(TabledMessage):
    """The states of several parts of a robot."""

    type_name = "diagnostic_msgs/msg/DiagnosticArray"
    plotted = False
    ros_fields = ros.table(status=ros.several("statuses", DiagnosticStatus))

    statuses: tuple[DiagnosticStatus, ...]
    header: Header = Header()


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

    type_name = "rcl_interfaces/msg/ParameterEvent"

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
    raise ValueError(
        f"parameter {parameter.name}: only bool, integer, double and string are supported"
    )
