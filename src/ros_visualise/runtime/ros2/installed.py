"""The ROS 2 that a process is going to use, checked before rclpy is imported."""

from __future__ import annotations

import os
import platform
from importlib import import_module
from typing import Any

from ros_visualise.core.errors import UsageError

LEAST = "humble"
"""The oldest release that is supported; the names of releases are in the order of the alphabet."""

_RMW = "RMW_IMPLEMENTATION"


def check_installed() -> None:
    """Find out whether this is a ROS 2 that can be used.

    Raises:
        UsageError: it is too old, or something of it is not installed.
    """
    distro = os.environ.get("ROS_DISTRO", LEAST)
    if distro < LEAST:
        name, least = distro.capitalize(), LEAST.capitalize()
        raise UsageError(f"ROS 2 {name} is too old; source the setup.bash of {least} or later")
    _check_rmw()
    _import("rclpy")


def _check_rmw() -> None:
    """Find out whether the library that carries messages is there; without it rclpy would exit."""
    resources = _import("ament_index_python").get_resources("rmw_typesupport")
    wanted, there = os.environ.get(_RMW), sorted(set(resources) - {"rmw_implementation"})
    if wanted and there and wanted not in there:
        package = f"ros-$ROS_DISTRO-{wanted.replace('_', '-')}"
        raise UsageError(
            f"{_RMW}={wanted}: not installed; choose one that is ({', '.join(there)}), or run:"
            f" apt install {package}"
        )


def _import(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        why, python = str(error).splitlines()[0], platform.python_version()
        raise UsageError(
            f"cannot import {name} of ROS 2 ({why}); source the setup.bash of a ROS 2 built for"
            f" Python"
            f" {python.rpartition('.')[0]}"
        ) from None
