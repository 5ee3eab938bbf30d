"""Nodes go on while there is no master, and are found by the one that comes back."""

import signal
import subprocess
import xmlrpc.client
from pathlib import Path

import pytest
from ros_graph import free_port, wait_for

from ros_visualise.running.executables import command_of

VIDEO = Path("video") / "vtest.avi"
STARTED = {"streamer": "/image_raw", "edge_detector": "/edges"}


class Graph:
    """A master that can be killed, and our executables around it."""

    def __init__(self, environment, folder, video):
        self.port = free_port()
        self.environment = {**environment, "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}"}
        self.folder = folder
        self.nodes = {}
        self.start_master()
        self.start("streamer", f"_path:={video}", "_loop:=true")
        self.start("edge_detector", "processed_image:=image_raw", "_low:=77")
        wait_for(self.is_whole, "the nodes")

    def start_master(self):
        command = ["rosmaster", "--core", "-p", str(self.port)]
        self.master = subprocess.Popen(command, env=self.environment, stdout=subprocess.DEVNULL)

    def kill_master(self):
        self.master.kill()
        self.master.wait()

    def start(self, name, *args):
        command = [*command_of(name), *args]
        with (self.folder / name).open("w") as output:
            self.nodes[name] = subprocess.Popen(
                command, env=self.environment, stdout=output, stderr=subprocess.STDOUT
            )

    def is_whole(self):
        """Whether the master knows all that they publish and serve."""
        master = xmlrpc.client.ServerProxy(self.environment["ROS_MASTER_URI"])
        try:
            publishers, _, services = master.getSystemState("/tests")[2]
        except OSError:
            return False
        published = {topic for topic, _ in publishers}
        served = {service for service, _ in services}
        settings = {f"/{name}/set_parameters" for name in STARTED}
        return published >= set(STARTED.values()) and served >= settings

    def said(self, name):
        return (self.folder / name).read_text()

    def call(self, *command):
        return subprocess.run(
            command, env=self.environment, text=True, capture_output=True, timeout=60
        ).stdout

    def end(self):
        for process in (*self.nodes.values(), self.master):
            if process.poll() is None:
                process.kill()
                process.wait()


@pytest.fixture
def graph(ros_master, tmp_path, recordings):
    graph = Graph(ros_master.environment, tmp_path, recordings / VIDEO)
    yield graph
    graph.end()


def test_nodes_outlive_their_master_and_are_found_by_the_next(graph):
    graph.kill_master()
    for name in STARTED:
        wait_for(lambda name=name: "register again when" in graph.said(name), name)
    graph.start_master()
    wait_for(graph.is_whole, "the nodes")
    assert "frame_id" in graph.call("rostopic", "echo", "-n", "1", "--noarr", "/edges")
    wait_for(lambda: graph.call("rosparam", "get", "/edge_detector/low").strip() == "77", "low")
    graph.kill_master()
    for name, process in graph.nodes.items():
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0, graph.said(name)
        assert "Traceback" not in graph.said(name)


def test_a_master_that_starts_anew_at_once_is_noticed(graph):
    graph.kill_master()
    graph.start_master()
    wait_for(graph.is_whole, "the nodes")


def test_a_node_ends_with_its_master_where_it_is_asked_to(graph):
    graph.start("filters", "controlled_stream:=image_raw", "_end_with_master:=true")
    wait_for(lambda: "/filters/blur" in graph.call("rosparam", "list"), "filters")
    graph.kill_master()
    assert graph.nodes["filters"].wait(60) == 0
    assert graph.nodes["streamer"].poll() is None
    assert "unknown parameters" not in graph.said("filters")


def test_a_master_that_does_not_answer_holds_up_no_end(graph):
    graph.master.send_signal(signal.SIGSTOP)
    for process in graph.nodes.values():
        process.send_signal(signal.SIGINT)
    for name, process in graph.nodes.items():
        assert process.wait(60) == 0, graph.said(name)
        assert "Traceback" not in graph.said(name)
