"""The time of a graph."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ros_visualise.data import ros_fields as ros


@dataclass(frozen=True)
class ClockTime(ros.TabledMessage, known=False):
    """A time, as on ``/clock``."""

    type_name: ClassVar[str] = "rosgraph_msgs/msg/Clock"
    ros_fields: ClassVar[ros.RosFields] = {"clock": ros.stamp("time_ns")}

    time_ns: int
