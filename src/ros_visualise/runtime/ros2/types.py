"""The types of ROS 2's messages: as rclpy knows them, and as their bytes are read."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory

from ros_visualise.core.errors import UsageError
from ros_visualise.messages.definitions import Definitions

_BETWEEN = "=" * 80
_PART = re.compile(r"(\w+)/(\w+)")

DEFINITIONS = Definitions("cdr")
"""Reader of messages: rclpy's own classes make an object of every number."""


@cache
def message_class(type_name: str) -> Any:
    """The class of the messages of a type, as ``sensor_msgs/msg/Image``.

    Raises:
        UsageError: its package is not installed, or has no such type.
    """
    package, _, name = type_name.partition("/msg/")
    try:
        found = getattr(import_module(f"{package}.msg"), name, None)
    except ImportError:
        found = None
    if not hasattr(found, "get_fields_and_field_types"):  # ROS 1 may have a package of this name
        advice = f"apt install ros-$ROS_DISTRO-{package.replace('_', '-')}"
        raise UsageError(f"{type_name}: unknown message type; {advice}, or source its workspace")
    if not DEFINITIONS.knows(type_name):
        texts = _installed(type_name)
        own = texts.pop(type_name)
        others = [
            f"{_BETWEEN}\nMSG: {name.replace('/msg/', '/')}\n{t}" for name, t in texts.items()
        ]
        DEFINITIONS.define(type_name, "\n".join([own, *others]))
    return found


def _installed(type_name: str) -> dict[str, str]:
    """The text of a type that ROS 2 itself has not, and those of all that it is made of."""
    package, _, name = type_name.partition("/msg/")
    path = Path(get_package_share_directory(package), "msg", f"{name}.msg")
    texts = {type_name: path.read_text()}
    fields = getattr(import_module(f"{package}.msg"), name).get_fields_and_field_types()
    for part in _PART.findall(" ".join(fields.values())):
        other = "/msg/".join(part)
        if not DEFINITIONS.knows(other):
            texts |= _installed(other)
    return texts
