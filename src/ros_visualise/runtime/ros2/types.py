"""The types of ROS 2's messages: as rclpy knows them, and as their bytes are read."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from ros_visualise.errors import UsageError
from ros_visualise.messages.definitions import Definitions

DEFINITIONS = Definitions("cdr")
"""What messages are read by: rclpy's own classes make an object of every number."""


@cache
def message_class(type_name: str) -> Any:
    """The class of the messages of a type, as ``sensor_msgs/msg/Image``.

    Raises:
        UsageError: its package is not installed, or has none of that name.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        found = getattr(import_module(f"{package}.msg"), name, None)
    except ImportError:
        found = None
    if not hasattr(found, "get_fields_and_field_types"):  # ROS 1 may have a package of this name
        advice = f"apt install ros-$ROS_DISTRO-{package.replace('_', '-')}"
        raise UsageError(f"{type_name}: no such messages here; {advice}, or source where they are")
    return found
