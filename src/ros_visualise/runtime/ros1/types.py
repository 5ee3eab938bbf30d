"""The classes of ROS 1's own Python messages, for `ros_visualise.messages`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import genpy

from ros_visualise.data import Message
from ros_visualise.errors import UsageError


class _Types(dict[str, Any]):
    """Imports the class of a type when it is first asked for.

    Raises:
        KeyError: ROS 1 has no such message, or its package is not installed.
    """

    def __missing__(self, type_name: str) -> Any:
        package, _, name = type_name.partition("/msg/")
        try:
            found = getattr(import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError):
            raise KeyError(type_name) from None
        self[type_name] = found
        return found


TYPES = _Types(
    {"builtin_interfaces/msg/Time": genpy.Time, "builtin_interfaces/msg/Duration": genpy.Duration}
)
"""ROS type name, as ``sensor_msgs/msg/Image`` -> class."""


def message_class(data_class: type[Message]) -> Any:
    """The class of the messages that a topic of ``data_class`` has.

    Raises:
        UsageError: ROS 1 has none.
    """
    try:
        return TYPES[data_class.type_name]
    except KeyError:
        raise UsageError(f"ROS 1 has no message for {data_class.__name__}") from None
