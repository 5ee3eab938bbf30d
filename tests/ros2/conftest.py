"""Fixtures that need ROS 2: our executables as processes of its graph."""

from __future__ import annotations

import importlib.util
import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from ros2_graph import Nodes2

if TYPE_CHECKING:
    from ros_visualise.runtime.ros2.transport import Ros2Transport

_MISSING = "ROS 2 is not here; where it is, source its setup.bash first"
_HAS_ROS = importlib.util.find_spec("rclpy") is not None
_SAYS_SO = "test_quality.py"
"""The one file that is collected without ROS 2, to say that it is missing."""


class _WithoutRos(pytest.Module):
    def collect(self) -> Any:
        pytest.skip(_MISSING, allow_module_level=True)


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Without ROS 2 one file says so for all of them."""
    is_test = collection_path.suffix == ".py"
    return True if is_test and not _HAS_ROS and collection_path.name != _SAYS_SO else None


def pytest_pycollect_makemodule(module_path: Path, parent: Any) -> Any:
    """Skip where there is no ROS 2."""
    return None if _HAS_ROS else _WithoutRos.from_parent(parent, path=module_path)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Processes that start one another take long on a busy machine: only what hangs ends so."""
    folder = f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(folder):
            item.add_marker(pytest.mark.timeout(400))


@pytest.fixture(scope="session")
def graph() -> dict[str, str]:
    """The environment of a graph that nobody else is on."""
    os.environ["ROS_DOMAIN_ID"] = str(random.randrange(1, 100))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_VERSION"] = "2"
    return dict(os.environ)


@pytest.fixture(scope="session")
def ros2(graph: dict[str, str]) -> Iterator[Ros2Transport]:
    """This process as a node of the graph, ``/tests``."""
    from ros_visualise.runtime.ros2.session import Ros2Session
    from ros_visualise.runtime.ros2.transport import Ros2Transport

    made = Ros2Transport(Ros2Session("tests", []))
    yield made
    made.close()


@pytest.fixture
def start(graph: dict[str, str]) -> Iterator[Callable[..., Any]]:
    """Starts executables of ours that run until the test ends; see `ros2_graph.Nodes2.start`."""
    nodes = Nodes2()
    yield nodes.start
    nodes.stop()
