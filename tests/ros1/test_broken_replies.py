"""A ROS master whose replies are broken on the way is one that does not answer."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import rospy
from breaking_master import WORDS, BreakingMaster
from ros_graph import Master, Nodes, end
from sensor_msgs.msg import Image
from waiting import wait_for

from ros_visualise.core.errors import Unreachable
from ros_visualise.runtime.ros1 import registration
from ros_visualise.runtime.ros1.transport import Ros1Transport


@pytest.fixture
def breaking(ros_master: Master) -> Iterator[BreakingMaster]:
    with closing(BreakingMaster(ros_master.uri)) as made:
        yield made


@pytest.mark.parametrize("how", WORDS)
def test_a_broken_list_of_the_graph_is_no_answer(
    breaking: BreakingMaster, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", breaking.uri)
    wait_for(lambda: Ros1Transport().listing().publishers, "this node at the master")
    with breaking.broken(how), pytest.raises(Unreachable, match="the ROS master does not answer"):
        Ros1Transport().listing()
    assert Ros1Transport().listing().publishers


def test_a_master_that_takes_the_call_and_says_nothing_is_not_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(registration, "_PATIENCE_S", 0.2)
    monkeypatch.setattr(registration.BoundedTransport, "_patience_s", 0.2)
    with closing(socket.create_server(("127.0.0.1", 0))) as silent:
        host, port = silent.getsockname()
        monkeypatch.setenv("ROS_MASTER_URI", f"http://{host}:{port}")
        with pytest.raises(Unreachable, match="does not answer"):
            Ros1Transport().listing()


@pytest.mark.parametrize("how", ["cut", "no list", "of no lists", "of no numbers"])
def test_a_node_registers_again_after_broken_replies(
    breaking: BreakingMaster, ros_master: Master, how: str
) -> None:
    nodes = Nodes(ros_master)
    ros_master.environment["ROS_MASTER_URI"] = breaking.uri
    try:
        node = nodes.start("filters")
    finally:
        ros_master.environment["ROS_MASTER_URI"] = ros_master.uri
    proxy: Any = ros_master.proxy()

    def publishes() -> bool:
        _, _, (publishers, _, _) = proxy.getSystemState("/tests")
        return "/filters" in dict(publishers).get("/processed_image", [])

    wait_for(publishes, "the topic")
    try:
        with breaking.broken(how):
            _, _, uri = proxy.lookupNode("/tests", "/filters")
            proxy.unregisterPublisher("/filters", "/processed_image", uri)
            time.sleep(2.0)  # some calls of the node
        wait_for(publishes, "the node to register again")
        images = rospy.Publisher("/controlled_stream", Image, queue_size=1)
        wait_for(images.get_num_connections, "the node to connect to a new publisher")
        images.unregister()
        said = end(node)
        assert (node.returncode, "Traceback" in said) == (0, False), said
    finally:
        nodes.stop()
