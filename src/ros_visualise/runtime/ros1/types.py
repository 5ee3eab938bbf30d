"""The classes of ROS 1's own Python messages, for `ros_visualise.messages`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import genpy
from genpy.dynamic import generate_dynamic

from ros_visualise.core.errors import UsageError
from ros_visualise.messages.definitions import Definitions

DEFINITIONS = Definitions("ros1")
"""Those of ROS 1's own types."""


class _Types(dict[str, Any]):
    """Finds the class of a type when it is first asked for: that of its package, if installed.

    Raises:
        KeyError: ROS 1 has no such message.
    """

    def __missing__(self, type_name: str) -> Any:
        found = self[type_name] = _installed(type_name) or _generated(type_name)
        return found


TYPES = _Types(
    {
        "builtin_interfaces/msg/Time": genpy.Time,
        "builtin_interfaces/msg/Duration": genpy.Duration,
    }
)
"""ROS type name, as ``sensor_msgs/msg/Image`` -> class."""


def message_class(type_name: str) -> Any:
    """The class of the messages of a type, as ``sensor_msgs/msg/Image``.

    Raises:
        UsageError: ROS 1 has none.
    """
    try:
        return TYPES[type_name]
    except KeyError:
        raise UsageError(f"ROS 1 has no messages of type {type_name}") from None


def _installed(type_name: str) -> Any:
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name, None)
    except ImportError:
        return None


def _generated(type_name: str) -> Any:
    """A class made from the type's definition: it has the same MD5, and others understand it."""
    if not DEFINITIONS.knows(type_name):
        raise KeyError(type_name)
    name = type_name.replace("/msg/", "/")
    return generate_dynamic(name, DEFINITIONS.text(type_name))[name]
