"""The ROS executables, one for each node and source of this package and a few more.

``CMakeLists.txt`` asks for their names by ``python -m ros_visualise.running.executables``, and
writes a script for each. That needs only Python: packages of pip may not be installed yet.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.core.installation import check_installation
from ros_visualise.core.printing import print_status
from ros_visualise.core.registry import module_names
from ros_visualise.simulation.robots import ROBOTS

_CODE = """from ros_visualise.__main__ import run_executable

run_executable("{}")
"""
"""The scripts, after the line that names their interpreter."""


def names() -> list[str]:
    """Names of all executables."""
    nodes = [*module_names("ros_visualise.nodes"), *ROBOTS.builtin]
    return sorted([*nodes, "node", "pipeline", "viewer"])


def command_of(name: str) -> list[str]:
    """Run an executable by this interpreter as its script does, from the first line on."""
    return [sys.executable, "-c", _CODE.format(name)]


def run(name: str) -> None:
    """Run the executable of this name on a ROS graph, and exit with its status.

    The sourced workspace sets ``ROS_VERSION``.
    """
    try:
        check_installation()
        if os.environ.get("ROS_VERSION") == "2":
            import_module("ros_visualise.runtime.ros2.installed").check_installed()
            host = import_module("ros_visualise.runtime.ros2.host").Ros2Host()
        else:
            host = import_module("ros_visualise.runtime.ros1.host").Ros1Host()
        import_module("ros_visualise.running.executables.by_name").run(name, host)
    except RosVisualiseError as error:
        print_status(f"{name}: {error}")
        sys.exit(error.exit_status)
