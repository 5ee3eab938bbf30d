"""Lines of the log of a graph's nodes."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any, ClassVar

from ros_visualise.core.message import Message
from ros_visualise.data.fields import header, read_header, read_time, time
from ros_visualise.data.header import Header

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

    type_name: ClassVar[str] = "rcl_interfaces/msg/Log"
    plotted: ClassVar[bool] = False

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

    type_name: ClassVar[str] = "rosgraph_msgs/msg/Log"

    def fields(self) -> dict[str, Any]:
        level = next(theirs for theirs, ours in _LEVELS.items() if ours >= self.level)
        return {"header": header(self.header), "level": level, "topics": [], **self._text_fields()}

    @classmethod
    def read(cls, message: Any) -> Ros1Log:
        level = _LEVELS.get(int(message.level), logging.INFO)
        return cls(str(message.name), level, str(message.msg), read_header(message.header))
