"""The contract of faults over a ROS 1 graph, with stock publishers beside ours."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from contract_of_faults import *  # noqa: F403  # the tests themselves
from contract_of_faults import GARBAGE, GraphWorld, picture
from ros_graph import Master, Nodes, end, wait_for

from ros_visualise.runtime.ros1.messages import RawMessage
from ros_visualise.runtime.ros1.topics import Ros1Publisher
from ros_visualise.runtime.ros1.transport import Ros1Transport
from ros_visualise.runtime.topics import Subscription


class RawImage(RawMessage):
    """Bytes that are sent as if they were an image."""

    __slots__ = ()
    _type = "sensor_msgs/Image"


class Ros1World(GraphWorld):
    """The node as a process."""

    def __init__(self, own: Path, master: Master) -> None:
        super().__init__(Ros1Transport())
        self._own, self._master = own, master
        self._nodes = Nodes(master)
        self._stock: list[subprocess.Popen[str]] = []
        self._start()

    def _start(self) -> None:
        self._node = self._nodes.start("node", f"{self._own}:picky", node="picky")
        self.wait()

    def give_damaged(self) -> None:
        Ros1Publisher.publish(self.pictures, RawImage(GARBAGE))

    def another(self) -> Callable[[int], object]:
        def give(number: int) -> None:
            if not self._stock:
                image = picture(number)
                fields = f"height: 4, width: 6, encoding: mono8, step: 6, data: {[number] * 24}"
                header = f"header: {{stamp: {{nsecs: {image.header.stamp_ns}}}, frame_id: camera}}"
                self._publish("sensor_msgs/Image", f"{{{header}, {fields}}}")

        return give

    def intrude(self) -> None:
        self._publish("std_msgs/String", "data: no image")

    def _publish(self, kind: str, message: str) -> None:
        command = "rostopic", "pub", "-r", "20", "/picture", kind, message
        self._stock.append(self._master.run(*command))

    def stall(self) -> None:
        self._stock.append(self._master.run("rostopic", "echo", "--noarr", "/answer"))
        wait_for(self._is_echoed, "rostopic to listen")
        self._stock[-1].send_signal(signal.SIGSTOP)

    def _is_echoed(self) -> bool:
        _, _, (_, subscribers, _) = self._master.proxy().getSystemState("/tests")
        return any("rostopic" in node for node in dict(subscribers).get("/answer", []))

    def restart(self, subscription: Subscription) -> Subscription:
        assert self.end() == 0
        self.wait_until_gone()
        self._start()
        return subscription

    def end(self) -> int:
        end(self._node)
        status = self._node.returncode
        assert status is not None
        return status

    def close(self) -> None:
        for process in self._stock:
            process.send_signal(signal.SIGCONT)
            end(process)
        self._nodes.stop()
        super().close()


@pytest.fixture
def world(own: Path, ros_master: Master) -> Iterator[Ros1World]:
    made = Ros1World(own, ros_master)
    yield made
    made.close()
