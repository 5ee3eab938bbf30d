"""Single numbers, texts, bytes and times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ros_visualise.data import ros_fields as ros
from ros_visualise.data.fields import Fields
from ros_visualise.data.header import Header
from ros_visualise.data.ros_fields import TabledMessage


@dataclass(frozen=True)
class Number(TabledMessage):
    """A number, as std_msgs/Float64; the header is not sent on a ROS graph."""

    type_name = "std_msgs/msg/Float64"
    has_header = False
    ros_fields = ros.table(data=ros.Attribute("number", float))

    number: float
    header: Header = Header()


@dataclass(frozen=True)
class Text(TabledMessage):
    """A text, as std_msgs/String; the header is not sent on a ROS graph."""

    type_name = "std_msgs/msg/String"
    has_header = False
    plotted = False
    ros_fields = ros.table(data=ros.Attribute("text", str))

    text: str
    header: Header = Header()


@dataclass(frozen=True, eq=False)
class Octets(TabledMessage):
    """Bytes, as std_msgs/UInt8MultiArray; the header is not sent on a ROS graph."""

    type_name = "std_msgs/msg/UInt8MultiArray"
    has_header = False
    plotted = False
    ros_fields = ros.table(
        layout=ros.Unused(Fields("std_msgs/msg/MultiArrayLayout", {"dim": [], "data_offset": 0})),
        data=ros.array("data", -1, dtype=np.uint8),
    )

    data: npt.NDArray[np.uint8]
    header: Header = Header()


@dataclass(frozen=True)
class ClockTime(ros.TabledMessage, known=False):
    """A time, as on ``/clock``."""

    type_name = "rosgraph_msgs/msg/Clock"
    ros_fields = ros.table(clock=ros.stamp("time_ns"))

    time_ns: int
