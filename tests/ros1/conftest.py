"""Fixtures that need ROS 1: a master, and our executables as processes of its graph."""

from __future__ import annotations

import importlib.util
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from catkin_workspace import Workspace
from ros_graph import Heard, Master, Nodes

MASTERS: list[Master] = []  # one at most, once a test has asked for it
_MISSING = "ROS 1 is not installed; on Debian `make test` installs it"


class _WithoutRos(pytest.Module):
    def collect(self) -> Any:
        if os.environ.get("CI"):
            pytest.fail(_MISSING)
        pytest.skip(_MISSING, allow_module_level=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Processes that start one another take long on a busy machine: only what hangs ends so."""
    folder = f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(folder):
            item.add_marker(pytest.mark.timeout(400))


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
    MASTERS.append(master)
    yield master
    MASTERS.clear()
    rospy.signal_shutdown("end of the tests")
    master.stop()


@pytest.fixture(scope="module", autouse=True)
def _no_parameters_for_other_files() -> Iterator[None]:
    """What a file's nodes and launches set would hold for nodes of other files, too."""
    yield
    for master in MASTERS:
        master.forget()


@pytest.fixture(scope="session")
def workspace(ros_master: Master, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """This package in a workspace of its own; its ``environment`` is the devel space's."""
    return Workspace(tmp_path_factory.mktemp("catkin") / "workspace", ros_master.environment)


@pytest.fixture
def start(ros_master: Master) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts executables of ours that run until the test ends; see `ros_graph.Nodes.start`."""
    nodes = Nodes(ros_master)
    yield nodes.start
    nodes.stop()


@pytest.fixture
def hear(ros_master: Master) -> Iterator[Callable[[str, Any], Heard]]:
    """Subscribes, as stock ROS does, until the test ends; see `ros_graph.Heard`."""
    heard: list[Heard] = []

    def hear(topic: str, message_class: Any) -> Heard:
        heard.append(Heard(topic, message_class))
        return heard[-1]

    yield hear
    for one in heard:
        one.subscriber.unregister()
