"""Diagnostics: the states of nodes and devices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, ClassVar

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields
from ros_visualise.data.header import Header
from ros_visualise.data.ros_fields import TabledMessage


class Level(IntEnum):
    """Severity, as numbered by diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class DiagnosticStatus:
    """The state of one part of a robot: a sentence, and values by name."""

    type_name: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticStatus"

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

    type_name: ClassVar[str] = "diagnostic_msgs/msg/DiagnosticArray"
    plotted: ClassVar[bool] = False
    ros_fields: ClassVar[ros.RosFields] = {
        "header": ros.HEADER,
        "status": ros.several("statuses", DiagnosticStatus),
    }

    statuses: tuple[DiagnosticStatus, ...]
    header: Header = Header()
