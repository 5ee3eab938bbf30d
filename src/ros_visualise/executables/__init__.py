"""What the ROS executables do; those in ``nodes/`` only call `run`."""

from __future__ import annotations

import sys
from importlib import import_module

from ros_visualise.errors import RosVisualiseError
from ros_visualise.installation import check_installation
from ros_visualise.printing import say


def run(name: str) -> None:
    """Run the executable of this name on a ROS 1 graph, and leave with its exit status."""
    try:
        check_installation()
        middleware = import_module("ros_visualise.runtime.ros1.middleware").Ros1()
        import_module("ros_visualise.executables.by_name").run(name, middleware)
    except RosVisualiseError as error:
        say(f"{name}: {error}")
        sys.exit(error.exit_status)
