"""Single numbers, such as how far an estimate is from the truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ros_visualise.core.message import Message
from ros_visualise.data.header import Header


@dataclass(frozen=True)
class Number(Message):
    """A number, as std_msgs/Float64; the header is left behind on a ROS graph."""

    type_name: ClassVar[str] = "std_msgs/msg/Float64"
    has_header: ClassVar[bool] = False

    number: float
    header: Header = Header()

    def fields(self) -> dict[str, Any]:
        """The fields of a std_msgs/msg/Float64."""
        return {"data": self.number}

    @classmethod
    def read(cls, message: Any) -> Number:
        """The number in a std_msgs/msg/Float64."""
        return cls(float(message.data))
