"""Texts <-> std_msgs/msg/String."""

from __future__ import annotations

from typing import Any

from ros_visualise.data import Text


def write_text(text: Text) -> dict[str, Any]:
    """The fields of a std_msgs/msg/String."""
    return {"data": text.text}


def read_text(message: Any) -> Text:
    """The text in a std_msgs/msg/String."""
    return Text(str(message.data))
