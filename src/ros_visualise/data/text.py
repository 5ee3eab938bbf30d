"""Texts, such as the description of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ros_visualise.core.message import Message
from ros_visualise.data.header import Header


@dataclass(frozen=True)
class Text(Message):
    """A text, as std_msgs/String; the header is left behind on a ROS graph."""

    type_name: ClassVar[str] = "std_msgs/msg/String"
    has_header: ClassVar[bool] = False
    plotted: ClassVar[bool] = False

    text: str
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a std_msgs/msg/String."""
        return {"data": self.text}

    @classmethod
    def read(cls, message: Any) -> Text:
        """The text in a std_msgs/msg/String."""
        return cls(str(message.data))
