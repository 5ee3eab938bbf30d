"""What the ROS executables do; those in ``nodes/`` only call `run`."""

from __future__ import annotations

import os
import sys
from importlib import import_module

from ros_visualise.errors import RosVisualiseError
from ros_visualise.installation import check_installation
from ros_visualise.printing import say


def run(name: str) -> None:
    """Run the executable of this name on the graph of a ROS, and leave with its exit status.

    It is the ROS of the workspace that was sourced: that sets ``ROS_VERSION``.
    """
    try:
        check_installation()
        if os.environ.get("ROS_VERSION") == "2":
            import_module("ros_visualise.runtime.ros2.installed").check_installed()
            middleware = import_module("ros_visualise.runtime.ros2.middleware").Ros2()
        else:
            middleware = import_module("ros_visualise.runtime.ros1.middleware").Ros1()
        import_module("ros_visualise.executables.by_name").run(name, middleware)
    except RosVisualiseError as error:
        say(f"{name}: {error}")
        sys.exit(error.exit_status)
