"""The page of a graph that changes while somebody looks: what is the same stays."""

import json
import time
from typing import ClassVar

import numpy as np
import pytest
from page_client import TOKEN, Client, ImageClient, picture
from waiting import wait_for
from websockets.sync.client import connect

from ros_visualise.core.params import Parameters
from ros_visualise.data import Image
from ros_visualise.graph import Graph, Node
from ros_visualise.nodes import NodeType, NoParams, find
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.report import NodeReport, RunReport, TopicReport
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.topics import TopicsHub
from ros_visualise.ui.page import Page
from ros_visualise.ui.shell.offered import OfferedHub


def make(name, output=None, params=NoParams):
    outputs = {} if output is None else {output: output}
    declared = NodeType(name, None, params, {}, dict.fromkeys(outputs, Image))
    return Node(name, declared, params(), {}, outputs)


class Changing:
    """A graph whose nodes a test takes away and adds."""

    name = ""
    diagnostic_topics: ClassVar = {}
    playback = None

    def __init__(self):
        self.graph = Graph(None, ())
        self.parameters = {}
        self.looked_at = []

    def show(self, *nodes):
        for node in nodes:
            self.parameters.setdefault(node.name, Parameters(node.params))
        self.graph = Graph(None, nodes)

    def subscribe(self, topic, depth=1):
        inbox = Inbox(lossless=False)
        shape = (0, 0) if topic == "/empty" else (6, 8)
        inbox.put(Packet(0, Image(np.zeros(shape, np.uint8), "mono8"), 0))
        self.looked_at.append(topic)
        return Subscription(topic, inbox, lambda: self.looked_at.remove(topic))

    def report(self, window_s=None):
        topic = TopicReport("sensor_msgs/msg/Image", 0, None, None)
        nodes = {node.name: NodeReport() for node in self.graph.nodes}
        return RunReport(dict.fromkeys(self.graph.topics, topic), nodes)


@pytest.fixture
def changing():
    return Changing()


@pytest.fixture
def client(changing, port):
    page = Page(ViewOptions(port=port))
    page.open(changing)
    client = Client(port)
    yield client
    client.close()
    page.close()


def test_an_empty_graph_says_so_until_somebody_comes(client, changing, port):
    assert "No nodes yet" in picture(port, "graph")
    changing.show(make("camera", "/image_raw"))
    client.read_until(lambda: changing.looked_at == ["/image_raw"])
    wait_for(lambda: "/image_raw" in picture(port, "graph"))
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}{TopicsHub.path}") as live:
        while not any("/image_raw" in row for row in json.loads(live.recv(timeout=60))["rows"]):
            pass
    with connect(f"ws://127.0.0.1:{port}/{TOKEN}{OfferedHub.path}") as live:
        offered = json.loads(live.recv(timeout=60))
        assert offered["topics"] == [["/image_raw", "sensor_msgs/msg/Image"]]
        assert offered["parameters"] == offered["actions"] == []
        changing.show(make("edge_detector", "/edges", find("edge_detector").params))
        while ["/edges", "sensor_msgs/msg/Image"] not in offered["topics"]:
            offered = json.loads(live.recv(timeout=60))
        assert ["edge_detector", "low"] in [one[:2] for one in offered["parameters"]]


def test_what_has_gone_is_not_looked_at_any_more(client, changing):
    edges = make("edge_detector", "/edges", find("edge_detector").params)
    changing.show(make("camera", "/image_raw"), edges)
    client.read_until(lambda: sorted(changing.looked_at) == ["/edges", "/image_raw"])
    changing.show(edges)
    client.read_until(lambda: changing.looked_at == ["/edges"])


def test_graphs_that_change_fast_break_nothing(client, changing, caplog):
    nodes = [make(f"n{n}", f"/n{n}", find("fps_control").params) for n in range(4)]
    for turn in range(30):
        changing.show(*[node for n, node in enumerate(nodes) if (turn >> n % 3) & 1])
        client.read_until(lambda: True)
        time.sleep(0.05)
    changing.show(*nodes)
    client.read_until(lambda: sorted(changing.looked_at) == ["/n0", "/n1", "/n2", "/n3"])
    assert not [record for record in caplog.records if record.exc_info]


def test_an_image_without_pixels_is_told_and_keeps_no_other_from_being_shown(
    client, changing, port
):
    looking = ImageClient(port)
    looking.show("/empty", "/image_raw")  # before they are there
    changing.show(make("broken", "/empty"), make("camera", "/image_raw"))
    looking.read_until(lambda: len(looking.images) == 2)
    found = {facts["key"]: facts for facts, _ in looking.images}
    assert found["/empty"]["problem"] == "the image has no pixels"
    assert [found["/image_raw"][name] for name in ("width", "height")] == [8, 6]
    looking.socket.close()
