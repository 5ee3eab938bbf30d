"""Fixtures that need ROS 1: a master, and our executables as processes of its graph."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from catkin_workspace import Workspace
from ros_graph import Master, end, is_ready, wait_for

NODES = Path(__file__).parents[2] / "nodes"
_MISSING = "ROS 1 is not installed here; on Debian: sh tests/install-debian-packages.sh"


class _WithoutRos(pytest.Module):
    def collect(self) -> Any:
        if os.environ.get("CI"):
            pytest.fail(_MISSING)
        pytest.skip(_MISSING, allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: Any) -> Any:
    """Skip what needs ROS where there is none, and say what to install."""
    if importlib.util.find_spec("rospy") is None:
        return _WithoutRos.from_parent(parent, path=module_path)
    return None


@pytest.fixture(scope="session")
def ros_master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    """A real roscore; this process is a node of its graph, ``/tests``."""
    master = Master(tmp_path_factory.mktemp("ros"))
    os.environ.update(master.environment)
    import rospy

    rospy.init_node("tests", argv=["tests"], disable_signals=True)
    yield master
    rospy.signal_shutdown("end of the tests")
    master.stop()


@pytest.fixture(scope="session")
def workspace(ros_master: Master, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """This package in a workspace of its own; its ``environment`` is the devel space's."""
    return Workspace(tmp_path_factory.mktemp("catkin") / "workspace", ros_master.environment)


@pytest.fixture
def start(ros_master: Master) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """``start("filters", "_gray:=false")`` runs one of our executables until the test ends.

    It returns when the node is there: its first parameters are set, its topics announced.
    """
    import rosgraph

    started: list[subprocess.Popen[str]] = []

    def start(name: str, *args: str, wait: bool = True) -> subprocess.Popen[str]:
        process = ros_master.run(sys.executable, str(NODES / name), *args)
        started.append(process)
        given = [arg.removeprefix("__name:=") for arg in args if arg.startswith("__name:=")]
        node = f"/{(given or [name])[0]}"
        if wait:
            wait_for(lambda: is_ready(rosgraph.Master("/tests"), node, process), node)
        return process

    yield start
    for process in started:
        process.terminate()
    for process in started:
        end(process)
