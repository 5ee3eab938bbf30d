"""Which RMW, the library that carries ROS 2's messages, a process is going to use."""

from __future__ import annotations

import os

from ament_index_python import get_resources

from ros_visualise.errors import UsageError

_VARIABLE = "RMW_IMPLEMENTATION"


def check_rmw() -> None:
    """Find out whether it is installed; to be called before rclpy is imported, which would exit.

    Raises:
        UsageError: it is not.
    """
    wanted = os.environ.get(_VARIABLE)
    there = sorted(set(get_resources("rmw_typesupport")) - {"rmw_implementation"})
    if wanted and there and wanted not in there:
        package = f"ros-$ROS_DISTRO-{wanted.replace('_', '-')}"
        raise UsageError(
            f"{_VARIABLE}={wanted}: not installed, only {', '.join(there)}; choose one of those,"
            f" or apt install {package}"
        )
