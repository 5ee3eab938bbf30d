"""What the page is made of, without a browser."""

import threading
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from enum import Enum
from itertools import combinations, pairwise
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import param, specs
from ros_visualise.data import Image
from ros_visualise.graph import Graph, Node
from ros_visualise.graph.pipelines import build, image_pipeline
from ros_visualise.nodes import NodeType, NoParams
from ros_visualise.plotting.colors import PALETTE
from ros_visualise.runtime.remote.declaration import ParameterDescription, declared
from ros_visualise.runtime.report import NodeReport, RunReport, TopicReport
from ros_visualise.ui.live.declared import declaration, sent
from ros_visualise.ui.live.topics import lines_of, topic_rows
from ros_visualise.ui.page.graph import graph_picture
from ros_visualise.ui.trackbars import scale_of
from ros_visualise.ui.worker import PageWorker


class Mode(Enum):
    SOFT = "soft"
    HARD = 3


@dataclass(frozen=True)
class Every:
    count: int = param(5, "a count", min=0, max=800)
    far: int = param(60, "beyond its slider", min=0, max=240, slider=(0, 30))
    ratio: float = param(0.5, "a ratio", min=0.0, max=20.0)
    free: int = param(7, "no upper limit", min=1)
    on: bool = param(True, "a switch")
    name: str = param("x", "a text")
    mode: Mode = param(Mode.HARD, "a choice")


@pytest.fixture
def elements():
    return {spec.name: declaration(spec) for spec in specs(Every)}


def test_a_parameter_of_a_foreign_node_is_as_that_describes_it():
    range_ = {"min": 0, "max": 2, "step": 0.5}
    told = [
        ParameterDescription("min_x", float, 1.0, **range_, label="min-x"),
        ParameterDescription("free", int, 3, step=3),
        ParameterDescription("gains", str, "[1.0, 2.5]", read_only=True),
    ]
    params = declared(told)
    min_x, free, gains = specs(params)
    shown = {"label": "Min-x", "low": 0, "high": 2, "step": 0.5}
    assert shown.items() <= declaration(min_x).items()
    assert scale_of(min_x).last == 4
    assert {"label": "Free", "kind": "int", "step": 3}.items() <= declaration(free).items()
    assert "low" not in declaration(free)
    assert (gains.used(params()), min_x.used(params())) == (False, True)
    assert [spec.saved for spec in (min_x, free, gains)] == [False, True, False]


def test_no_two_colours_look_alike():
    lab = cv2.cvtColor(np.array([PALETTE], np.float32) / 255, cv2.COLOR_RGB2LAB)[0]
    for one, other in combinations(lab, 2):
        assert np.linalg.norm(one - other) > 30  # CIE 1976; one that is just seen is 2.3
    assert len(PALETTE) >= 12


def test_each_type_is_declared(elements):
    assert elements["count"] == {
        "name": "count",
        "label": "Count",
        "kind": "int",
        "help": "a count",
        "group": "",
        "min": 0,
        "max": 800,
        "low": 0,
        "high": 800,
        "step": 1,
    }
    assert {"kind": "int", "min": 1}.items() <= elements["free"].items()
    assert not {"low", "max", "step"} & elements["free"].keys()
    assert [elements[name]["kind"] for name in ("on", "name", "mode")] == ["bool", "str", "choice"]
    assert elements["mode"]["choices"] == ("soft", "3")
    assert sent(Mode.HARD) == "3"
    assert sent(float("inf")) == "inf"


def test_a_slider_is_narrower_than_the_limits_and_has_round_steps(elements):
    far = {"low": 0, "high": 30, "max": 240, "step": 1}
    assert far.items() <= elements["far"].items()
    assert {"low": 0.0, "high": 20.0, "step": 0.1}.items() <= elements["ratio"].items()


def test_the_picture_shows_every_node_and_topic_below_what_leads_to_it():
    graph = image_pipeline("landscape")
    picture = ET.fromstring(graph_picture(graph))
    heights = {text.text: float(text.get("y")) for text in picture.iter("text")}
    assert set(heights) == {node.name for node in graph.members} | set(graph.topics)
    for node in graph.members:
        assert all(heights[topic] < heights[node.name] for topic in node.inputs.values())
        assert all(heights[topic] > heights[node.name] for topic in node.outputs.values())
    assert sum(1 for _ in picture.iter("path")) == 1 + len(graph.topics) + 3  # with the arrow's tip


def places_in(graph):
    picture = ET.fromstring(graph_picture(graph))
    texts = list(picture.iter("text"))
    return {text.text: (float(text.get("x")), float(text.get("y"))) for text in texts}


def test_what_comes_from_outside_stands_above_who_takes_it():
    heights = {name: y for name, (_, y) in places_in(image_chain()).items()}
    assert heights["/image_raw"] < heights["fps_control"] < heights["/edges"]


def image_chain():
    return build(None, "/image_raw")


def seen_elsewhere(name, takes, gives):
    declared = NodeType(
        name, None, NoParams, dict.fromkeys(takes, Image), dict.fromkeys(gives, Image)
    )
    return Node(name, declared, NoParams(), {t: t for t in takes}, {t: t for t in gives})


def test_a_circle_can_be_pictured():
    a, b = seen_elsewhere("a", ["/2"], ["/1"]), seen_elsewhere("b", ["/1"], ["/2"])
    assert set(places_in(Graph(None, (a, b)))) == {"a", "b", "/1", "/2"}
    assert set(places_in(Graph(None, (seen_elsewhere("c", ["/1"], ["/1"]),)))) == {"c", "/1"}


def test_an_empty_graph_is_pictured_in_words():
    assert "No nodes yet" in graph_picture(Graph(None, ()))


def test_graphs_of_many_topics_overlap_nowhere_and_stay_as_wide_as_they_can_be_read():
    names = [f"/camera_{n}/{'image_rect_color'[: n + 3]}" for n in range(18)]
    cameras = [seen_elsewhere(f"camera_{n}", [], [name]) for n, name in enumerate(names[:3])]
    player = seen_elsewhere("player", [], names[3:])
    for graph in (Graph(None, tuple(cameras)), Graph(None, (player,))):
        width = float(ET.fromstring(graph_picture(graph)).get("viewBox").split()[2])
        assert width == 320
        rows = {}
        for name, (x, y) in places_in(graph).items():
            rows.setdefault(y, []).append((x - 3.3 * len(name), x + 3.3 * len(name)))
        for row in rows.values():
            assert all(a[1] <= b[0] for a, b in pairwise(sorted(row)))
            assert 0 <= min(row)[0] <= max(row)[1] <= width


def test_topics_that_somebody_takes_stand_nearest_to_who_does():
    names = [f"/some/long/topic_{n}" for n in range(9)]
    player = seen_elsewhere("player", [], names)
    places = places_in(Graph(None, (player, seen_elsewhere("filters", [names[0]], []))))
    lowest = max(places[name][1] for name in names)
    assert places[names[0]][1] == lowest < places["filters"][1]


def test_the_table_tells_rates_drops_and_latency():
    dropped = {"rate": 4, "queue": 2}
    node = NodeReport(dropped=dropped, own={"requested_hz": 25}, p50_ms=1.26, gate="rate")
    topics = {"/controlled_stream": TopicReport("sensor_msgs/msg/Image", 9, 24.96, 25.1)}
    report = RunReport(topics, {"fps_control": node})
    assert topic_rows(image_pipeline("landscape"), report) == [
        [
            "/controlled_stream",
            "sensor_msgs/Image",
            *(24.96, 25.1, 25, 2, "4 (rate), 2 (queue)", 1.26),
        ]
    ]


def worker_of(said, tick=lambda: None):
    return PageWorker(said.append, tick, 60.0)


def test_the_way_that_was_gone_is_told():
    gone = {"length_m": 12.34, "duration_s": 10.0, "mean_mps": 1.234, "top_mps": None, "refused": 2}
    told = lines_of(RunReport({}, {"player": NodeReport(), "path": NodeReport(own=gone)}))
    assert list(told) == ["path: 12.3 m in 10.0 s, mean 1.23 m/s, 2 rejected"]


def test_what_is_lost_is_told_while_somebody_looks_on():
    lost = {"messages": 2, "bytes": 0, "notes": ["/<b>: 2 messages", "cut off"]}
    told = lines_of(RunReport({}, {"player": NodeReport(own={"lost": lost}), "path": NodeReport()}))
    assert list(told) == ["player: /<b>: 2 messages", "player: cut off"]


def test_only_the_newest_of_a_kind_is_done():
    done, finished = [], threading.Event()
    worker = worker_of([])
    for value in range(5):
        worker.post("slider", lambda value=value: done.append(value))
    assert worker.is_posted("slider")
    worker.post("end", finished.set)
    worker.start()
    assert finished.wait(10)
    worker.close(10)
    assert done == [4]
    assert not worker.is_posted("slider")


def test_a_flood_of_clicks_is_not_kept():
    done, finished = [], threading.Event()
    worker = worker_of([])
    for _ in range(100_000):
        worker.ask(object(), lambda: done.append(True))
    worker.post("end", finished.set)
    worker.start()
    assert finished.wait(10)
    worker.close(10)
    assert 100 <= len(done) <= 1000


def test_what_is_refused_is_said_and_the_work_goes_on():
    said, finished = [], threading.Event()

    def refuse():
        raise ParameterError("too much")

    worker = worker_of(said)
    worker.post("a", refuse)
    worker.post("b", finished.set)
    worker.start()
    assert finished.wait(10)
    worker.close(10)
    assert said == ["too much"]


def test_text_is_escaped_in_the_picture():
    node = SimpleNamespace(name="<b>", inputs={}, outputs={"out": "/a&b"})
    graph = SimpleNamespace(members=(node,), topics={"/a&b": None}, inputs={})
    assert [text.text for text in ET.fromstring(graph_picture(graph)).iter("text")] == [
        "<b>",
        "/a&b",
    ]
