"""The contract of faults over a ROS 2 graph, with stock publishers and subscribers beside ours."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest
import rclpy
from contract_of_faults import *  # noqa: F403  # the tests themselves
from contract_of_faults import GARBAGE, GraphWorld, picture
from rclpy.context import Context
from ros2_graph import Nodes2
from sensor_msgs.msg import Image as ImageMessage
from std_msgs.msg import String
from waiting import wait_for

from ros_visualise.runtime.ros2.transport import Ros2Transport
from ros_visualise.runtime.topics import Subscription

DEAF = """
import rclpy
from sensor_msgs.msg import Image
rclpy.init()
node = rclpy.create_node("deaf")
node.create_subscription(Image, "/answer", lambda image: None, 10)
rclpy.spin(node)
"""


class Ros2World(GraphWorld):
    """The node as a process."""

    def __init__(self, own: Path, ros2: Ros2Transport) -> None:
        super().__init__(ros2)
        self._own = own
        self._nodes = Nodes2()
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._stock = rclpy.create_node("stock", context=self._context)
        self._deaf: list[subprocess.Popen[bytes]] = []
        self._start()

    def _start(self) -> None:
        self._node = self._nodes.start("node", f"{self._own}:picky")
        self.wait()

    def give_damaged(self) -> None:
        publisher = self._stock.create_publisher(ImageMessage, "/picture", 10)
        wait_for(publisher.get_subscription_count, "the node")
        publisher.publish(GARBAGE)
        publisher.wait_for_all_acked()

    def another(self) -> Callable[[int], object]:
        publisher = self._stock.create_publisher(ImageMessage, "/picture", 10)
        wait_for(publisher.get_subscription_count, "the node")

        def give(number: int) -> None:
            message = ImageMessage(height=4, width=6, encoding="mono8", step=6, data=[number] * 24)
            message.header.stamp.nanosec = picture(number).header.stamp_ns
            publisher.publish(message)

        return give

    def intrude(self) -> None:
        publisher = self._stock.create_publisher(String, "/picture", 10)
        for _ in range(20):
            publisher.publish(String(data="no image"))

    def stall(self) -> None:
        self._deaf.append(subprocess.Popen([sys.executable, "-c", DEAF], env=os.environ))
        wait_for(self._is_listened_to, "somebody who listens")
        self._deaf[-1].send_signal(signal.SIGSTOP)

    def _is_listened_to(self) -> bool:
        listening = self._stock.get_subscriptions_info_by_topic("/answer")
        return any(one.node_name == "deaf" for one in listening)

    def restart(self, subscription: Subscription) -> Subscription:
        assert self.end() == 0
        self.wait_until_gone()
        self._start()
        return subscription

    def end(self) -> int:
        status, _ = self._nodes.end(self._node)
        return status

    def close(self) -> None:
        for process in self._deaf:
            process.kill()
            process.wait()
        self._nodes.stop()
        self._stock.destroy_node()
        self._context.shutdown()
        super().close()


@pytest.fixture
def world(own: Path, ros2: Ros2Transport) -> Iterator[Ros2World]:
    with closing(Ros2World(own, ros2)) as made:
        yield made
