"""The run report: the layout of its JSON, and which drops are wanted."""

import json
import re

import numpy as np

from ros_visualise.data import Header, Image
from ros_visualise.graph import Graph, Node, SourceNode, place
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.nodes import NoParams, node, source
from ros_visualise.nodes.fps_control import FpsControl
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.report import NodeReport, RunReport, to_json
from ros_visualise.sources.playback import Playback
from ros_visualise.ui.live.topics import topic_rows

IMAGES = 30


@source("lamp", params=NoParams, outputs={"image": Image})
class Lamp:
    def __init__(self, params, playback):
        pass

    def messages(self):
        for number in range(IMAGES):
            stamp_ns = number * 100_000_000
            yield "image", Image(np.full((2, 3), number, np.uint8), "mono8", Header(stamp_ns))

    def close(self):
        pass

    def report(self):
        return {"lost": {"messages": 1, "bytes": 2, "notes": ["a lamp"]}, "dropped": {"source": 3}}


@node("last", inputs={"image": Image}, outputs={})
class Last:
    def __init__(self, params):
        self._seen = 0

    def step(self, image, params):
        self._seen += 1

    def report(self):
        return {"seen": self._seen}


@node("bright", inputs={"image": Image}, outputs={"image": Image}, drops="dark")
def bright(image, params):
    return image if image.pixels[0, 0] >= 20 else None


def run(*nodes):
    lamp = SourceNode("lamp", Lamp.declared, NoParams(), {}, {"image": "/image_raw"})
    runtime = LocalRuntime(Graph(lamp, nodes), Playback(rate=0))
    runtime.start()
    assert runtime.wait(20)
    runtime.stop()
    return runtime.report()


def without_times(report):
    """Its JSON with the times of this run left out."""
    return re.sub(r'("(?:p50_ms|p99_ms|step_ms|wall_hz)": )[0-9.]+', r"\1T", json.dumps(report))


def test_the_layout_of_the_json():
    control = FpsControl.declared
    slow = Node("slow", control, control.params(fps=5), {"image": "/image_raw"}, {"image": "/slow"})
    report = run(slow, place(Last.declared, {"image": "/slow"}))
    assert without_times(to_json(report)) == (
        '{"topics": {"/image_raw": {"type": "sensor_msgs/msg/Image", "messages": 30, "hz": 10.0,'
        ' "wall_hz": T}, "/slow": {"type": "sensor_msgs/msg/Image", "messages": 15, "hz": 5.0,'
        ' "wall_hz": T}}, "nodes": {"lamp": {"received": 30, "processed": 30, "dropped":'
        ' {"source": 3}, "errors": 0, "p50_ms": null, "p99_ms": null, "step_ms": null, "lost":'
        ' {"messages": 1, "bytes": 2, "notes": ["a lamp"]}, "achieved_hz": 10.0}, "slow":'
        ' {"received": 30, "processed": 15, "dropped": {"rate": 15}, "errors": 0, "p50_ms": T,'
        ' "p99_ms": T, "step_ms": T, "requested_hz": 5, "achieved_hz": 5.0}, "last": {"received":'
        ' 15, "processed": 15, "dropped": {}, "errors": 0, "p50_ms": T, "p99_ms": T, "step_ms": T,'
        ' "seen": 15}}, "recordings": {}, "failures": []}'
    )


def test_what_a_gate_of_ones_own_leaves_out_is_not_lost():
    gate = place(bright.declared, {"image": "/image_raw"})
    told = run(gate).nodes["bright"]
    assert told.dropped == {"dark": 20}
    assert told.lost == 0


def test_the_page_counts_what_no_gate_left_out():
    graph = image_pipeline("landscape")
    topics = run().topics
    dropped = {"rate": 4, "dark": 8, "queue": 2}
    for gate, lost in (("rate", 10), ("dark", 6), (None, 14)):
        nodes = {"landscape": NodeReport(dropped=dropped, gate=gate)}
        assert {row[5] for row in topic_rows(graph, RunReport(topics, nodes))} == {lost}
