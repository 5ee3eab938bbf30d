"""A launched 4K video ends by itself, however it is ended."""

import os
import re
import signal
import subprocess
import time
import xmlrpc.client
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros_graph import Master, end, free_port, wait_for

from ros_visualise.running.executables import command_of

ROSLAUNCH_WAITS_S = 15  # and then ends a node by other means
NODES = {"/streamer", "/fps_control", "/filters", "/edge_detector"}


class Launched:
    """``roslaunch ros_visualise main_video.launch`` with a master of its own."""

    def __init__(self, environment: dict[str, str], *args: str) -> None:
        port = free_port()
        self.uri = f"http://127.0.0.1:{port}"
        self.environment = {**environment, "ROS_MASTER_URI": self.uri}
        command = ["roslaunch", "-p", str(port), "ros_visualise", "main_video.launch", *args]
        self.process = subprocess.Popen(
            command,
            env=self.environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.pids: dict[str, int] = {}

    def wait_for_images(self) -> None:
        """Until images come to the last node."""
        wait_for(lambda: self._find_nodes() >= NODES, "all nodes", 120)
        wait_for(lambda: self.published("/filters") > 0, "images")

    def published(self, node: str) -> int:
        """Bytes that a node has published."""
        _, _, uri = self._master().lookupNode("/tests", node)
        _, _, (published, *_) = xmlrpc.client.ServerProxy(uri).getBusStats("/tests")
        return sum(bytes_sent for _, bytes_sent, _ in published)

    def _master(self) -> xmlrpc.client.ServerProxy:
        return xmlrpc.client.ServerProxy(self.uri)

    def _find_nodes(self) -> set[str]:
        try:
            _, _, (publishers, *_) = self._master().getSystemState("/tests")
            names = {name for _, nodes in publishers for name in nodes}
            for name in names & NODES:
                _, _, uri = self._master().lookupNode("/tests", name)
                _, _, self.pids[name] = xmlrpc.client.ServerProxy(uri).getPid("/tests")
            return names
        except (OSError, xmlrpc.client.Error):
            return set()

    def alive(self) -> set[str]:
        return {name for name, pid in self.pids.items() if is_alive(pid)}


def is_alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def children(pid: int) -> list[int]:
    listed = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(child) for child in listed.split()]


@pytest.fixture
def launched(workspace: Master, recordings: Path) -> Iterator[Launched]:
    video = recordings / "video" / "DERIVED_4k_pan_dji0020.mp4"
    arguments = [f"video:={video}", "loop:=true", "view:=none", "rviz:=false"]
    launched = Launched(workspace.environment, *arguments)
    launched.wait_for_images()
    yield launched
    for pid in launched.pids.values():
        if is_alive(pid):
            os.kill(pid, signal.SIGKILL)
    end(launched.process)


def test_ctrl_c_ends_every_node(launched):
    launched.process.send_signal(signal.SIGINT)
    wait_for(lambda: not launched.alive(), "the nodes to end")
    said = launched.process.communicate(timeout=60)[0]
    assert "escalat" not in said
    assert "has died" not in said


def test_roslaunch_ends_its_nodes_when_its_master_is_gone(launched):
    [master] = [pid for pid in children(launched.process.pid) if "rosmaster" in command_line(pid)]
    os.kill(master, signal.SIGKILL)
    wait_for(lambda: not launched.alive(), "the nodes to end")
    said = launched.process.communicate(timeout=60)[0]
    assert "escalat" not in said


def test_rosnode_kill_ends_every_node(launched):
    killed = subprocess.run(
        ["rosnode", "kill", *NODES], env=launched.environment, capture_output=True, timeout=90
    )
    assert killed.returncode == 0
    wait_for(lambda: not launched.alive(), "the nodes to end")
    launched.process.send_signal(signal.SIGINT)
    said = launched.process.communicate(timeout=60)[0]
    assert "exit code" not in said  # the source is required, so roslaunch ended too


@pytest.mark.parametrize("after_s", [0, 0.2, 0.4, 0.6, 0.9, 1.4])
def test_ctrl_c_ends_a_node_that_only_begins(ros_master, after_s):
    command = [*command_of("edge_detector"), "__name:=begun"]
    node = ros_master.run(*command)
    wait_for(lambda: catches_sigterm(node.pid), "its first line")
    time.sleep(after_s)
    node.send_signal(signal.SIGINT)
    said = node.communicate(timeout=ROSLAUNCH_WAITS_S)[0]
    assert node.returncode == 0
    assert "Traceback" not in said


def catches_sigterm(pid: int) -> bool:
    [caught] = re.findall(r"SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text())
    return bool(int(caught, 16) >> signal.SIGTERM - 1 & 1)


def command_line(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text()
