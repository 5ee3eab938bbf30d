"""Texts, such as the description of a robot."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.data.header import Header


@dataclass(frozen=True)
class Text:
    """A text, as std_msgs/String; the header is left behind on a ROS graph."""

    text: str
    header: Header = Header()
