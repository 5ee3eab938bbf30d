"""The contract of nodes with several inputs over a ROS 2 graph."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from contract_of_nodes import *  # noqa: F403  # the tests themselves
from contract_of_nodes import GraphWorld
from ros2_graph import Nodes2

from ros_visualise.runtime.ros2.transport import Ros2Transport


@pytest.fixture
def world(own: Path, ros2: Ros2Transport) -> Iterator[GraphWorld]:
    nodes = Nodes2()
    try:
        with closing(GraphWorld(ros2)) as made:
            nodes.start("node", f"{own}:locator")
            made.wait()
            yield made
    finally:
        nodes.stop()
