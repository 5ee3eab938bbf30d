"""The contract of nodes with several inputs over a ROS 1 graph."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from contract_of_nodes import *  # noqa: F403  # the tests themselves
from contract_of_nodes import GraphWorld
from ros_graph import Master, Nodes

from ros_visualise.runtime.ros1.transport import Ros1Transport


@pytest.fixture
def world(own: Path, ros_master: Master) -> Iterator[GraphWorld]:
    nodes = Nodes(ros_master)
    try:
        with closing(GraphWorld(Ros1Transport())) as made:
            nodes.start("node", f"{own}:locator", node="locator")
            made.wait()
            yield made
    finally:
        nodes.stop()
