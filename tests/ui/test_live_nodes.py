"""Parameters, presets, actions and texts of nodes, as browsers see and set them."""

import json
import logging
import threading

import pytest
from page_client import VIEW_TOKEN, Live
from test_page_changes import Changing, make

from ros_visualise.core.supervision import PROCESS
from ros_visualise.data import Text
from ros_visualise.graph import Node
from ros_visualise.nodes import NodeType, NoParams, find
from ros_visualise.runtime.queues import Inbox, Packet
from ros_visualise.runtime.topics import Subscription
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page

NODES = "/live/nodes"


@pytest.fixture
def filters(runtime):
    return runtime.parameters["filters"]


@pytest.fixture
def live(page, port):
    with Live(port, NODES) as live:
        live.read_until(lambda: "edge_detector" in live.values)
        yield live


def declared(live, node, name):
    described = next(one for one in live.got if one.get("node") == node and "params" in one)
    return next(param for param in described["params"] if param["name"] == name)


def test_nodes_say_what_they_have(live):
    assert live.state["graph"] == ["landscape", "fps_control", "filters", "edge_detector"]
    threshold = declared(live, "filters", "threshold")
    expected = {"label": "Threshold", "kind": "int", "low": 0, "high": 255, "step": 1, "max": 255}
    assert expected.items() <= threshold.items()
    assert threshold["help"]
    assert declared(live, "filters", "gray")["kind"] == "bool"
    assert "otsu" in declared(live, "filters", "threshold_mode")["choices"]
    assert declared(live, "filters", "blur_size")["group"] == "Blur"
    assert live.values["filters"]["threshold"] == 128
    assert live.state["presets"][:2] == ["default", "seed"]


def test_a_value_that_is_set_is_answered_and_seen_by_all(live, page, port, filters):
    with Live(port, NODES, VIEW_TOKEN) as other:
        other.read_until(lambda: "filters" in other.values)
        assert live.set("filters", "threshold", 77)["reason"] == ""
        assert filters.current.threshold == 77
        other.read_until(lambda: other.values["filters"]["threshold"] == 77)
        filters.update({"threshold": 60})
        for one in (live, other):
            one.read_until(lambda one=one: one.values["filters"]["threshold"] == 60)
        assert not any("done" in message for message in other.got)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("threshold", 256, "threshold=256: must be from 0 to 255"),
        ("threshold", 1.5, "must be a whole number"),
        ("threshold", 2**53, "must be from 0 to 255"),
        ("threshold", 1e300, "must be a whole number"),
        ("threshold", "77", "must be a whole number"),
        ("threshold", True, "must be a whole number"),
        ("gray", 1, "must be true or false"),
        ("threshold_mode", "none at all", "choose one of"),
        ("threshold_mode", 3, "must be a string"),
        ("no_such", 1, "filters: no parameter 'no_such'"),
        ("__class__", "x", "filters: no parameter '__class__'"),
    ],
)
def test_a_rejected_value_is_answered_with_the_reason(live, filters, name, value, reason):
    before = filters.current
    assert reason in live.set("filters", name, value)["reason"]
    assert filters.current == before
    live.read_until(lambda: live.said(reason))


HOSTILE = [
    "",
    "[]",
    "1",
    "null",
    "[" * 30_000,
    '{"do": 5}',
    '{"do": "nothing"}',
    '{"do": "set", "values": {"filters": {"threshold": [3]}}}',
    '{"do": "set", "values": {"filters": {"threshold": NaN}}}',
    '{"do": "set", "values": {"filters": {"threshold": 3}}, "more": 1}',
    '{"do": "set", "values": {"filters": {"threshold": 3}}, "number": -1}',
    '{"do": "set", "values": {"filters": {"threshold": 1e999}}}',
    '{"do": "set", "values": {"filters": {"threshold": ' + "9" * 5000 + "}}}",
    '{"do": "set", "values": {"' + "x" * 300 + '": {"threshold": 3}}}',
    '{"do": "set", "values": {"\\ud800": {"threshold": 3}}}',
    '{"do": "set", "values": {"filters": {"\\udfff": 3}}}',
    '{"do": "set", "values": {"filters": {"gray": true}, "no such": {"a": 1}}}',
    '{"do": "preset", "name": "no such"}',
    '{"do": "reset", "node": "no such"}',
    '{"do": "reset", "node": "filters", "name": "no such"}',
    '{"do": "act", "node": "filters", "action": "no_such"}',
    '{"do": "act", "node": "no such", "action": "__init__"}',
    '{"do": "restore", "values": {"filters/threshold": "x", "a/b": 1, "": ""}}',
    '{"do": "restore", "values": {"filters/threshold": NaN}}',
    '{"do": "read", "topics": ["/no/such"]}',
]


def test_hostile_messages_change_nothing_and_end_nothing(live, filters, caplog):
    before = filters.current
    for text in HOSTILE:
        live.socket.send(text)
    live.socket.send(b"\xff\xfe")
    assert live.set("filters", "gray", before.gray)["reason"] == ""
    assert filters.current == before
    assert not [record for record in caplog.records if record.exc_info]


def test_a_viewer_changes_nothing(page, port, runtime):
    before = {name: one.current for name, one in runtime.parameters.items()}
    with Live(port, NODES) as owner, Live(port, NODES, VIEW_TOKEN) as viewer:
        owner.set("edge_detector", "low", 11)
        viewer.send("set", values={"filters": {"threshold": 3}})
        viewer.send("preset", name="soft")
        viewer.send("reset", node="edge_detector")
        viewer.send("act", node="path", action="clear")
        viewer.send("restore", values={"filters/threshold": 3})
        assert owner.set("edge_detector", "high", 12)["reason"] == ""
    after = {name: one.current for name, one in runtime.parameters.items()}
    assert (after["edge_detector"].low, after["edge_detector"].high) == (11, 12)
    assert before["filters"] == after["filters"]


def test_a_drag_leaves_no_queue_and_the_last_value(live, filters, monkeypatch):
    seen = []
    filters.on_change(lambda current, _: seen.append(current.threshold))
    for value in range(200):
        live.send("set", values={"filters": {"threshold": value}}, number=value)
    live.read_until(lambda: any(one.get("done") == 199 for one in live.got))
    assert filters.current.threshold == 199
    assert seen == sorted(seen)
    assert live.values["filters"]["threshold"] == 199


def answers(live, numbers):
    """The reasons that are answered to requests with these numbers."""
    live.read_until(lambda: {one.get("done") for one in live.got} >= set(numbers))
    return {one["done"]: one["reason"] for one in live.got if "done" in one}


def test_what_no_page_can_ask_is_answered_if_it_has_a_number(live, filters):
    values = {f"filters/{number}": 3 for number in range(201)}
    live.send("restore", values=values, number=1)
    live.send("set", values={"filters": {"threshold": None}}, number=2)
    assert "nothing was set" in answers(live, [1, 2])[1]
    live.read_until(lambda: live.said("a value is invalid: nothing was set"))
    assert filters.current.threshold == 128


def test_a_change_that_fails_is_answered(live, filters):
    def fail(*_):
        raise KeyError("a bug")

    forget = filters.on_change(fail)
    assert "internal error" in live.set("filters", "threshold", 77)["reason"]
    forget()
    assert live.set("filters", "threshold", 78)["reason"] == ""
    assert {failure.kind for failure in PROCESS.failures} == {"KeyError"}
    PROCESS.forget()


def test_changes_that_are_too_many_are_all_answered(live, filters):
    is_over = threading.Event()
    filters.on_change(lambda *_: is_over.wait(60))
    live.send("set", values={"filters": {"threshold": 77}}, number=1)
    for number in range(2, 300):
        live.send("set", values={f"none {number}": {"a": 1}}, number=number)
    assert "too many changes" in answers(live, [299])[299]
    is_over.set()
    reasons = answers(live, range(1, 300)).values()
    assert sum("too many" in reason for reason in reasons) == pytest.approx(98, abs=3)
    assert sum("no such node" in reason for reason in reasons) == pytest.approx(200, abs=3)


def test_an_answer_says_all_that_has_changed(live, runtime):
    after = live.answer("set", values={"filters": {"gray": False, "threshold": 128}})["after"]
    assert after == {"filters": {"gray": False}}
    after = live.answer("preset", name="soft")["after"]
    assert after["edge_detector"] == {"low": 30, "high": 90, "sigma": 1.4}
    assert live.answer("preset", name="soft")["after"] == {"filters": {}, "edge_detector": {}}


def test_presets_and_what_is_reset(live, runtime):
    edges = runtime.parameters["edge_detector"]
    began = edges.current
    live.send("preset", name="soft")
    live.read_until(lambda: live.state["preset"] == "soft")
    assert (edges.current.low, edges.current.sigma) == (30, 1.4)
    live.send("reset", node="edge_detector", name="sigma")
    live.read_until(lambda: live.values["edge_detector"]["sigma"] == began.sigma)
    live.read_until(lambda: live.state["preset"] == "")
    live.send("reset", node="edge_detector")
    live.read_until(lambda: live.values["edge_detector"]["low"] == began.low)
    assert edges.current == began


def test_what_has_no_effect_is_said(live, filters):
    assert "blur_size" in live.unused["filters"]
    live.set("filters", "blur", "median")
    live.read_until(lambda: "blur_size" not in live.unused["filters"])
    filters.update({"blur": "off"})
    live.read_until(lambda: "blur_size" in live.unused["filters"])


def test_settings_of_an_address_and_of_an_older_file_are_set(live, filters, runtime):
    values = {"filters/threshold": "78", "edge_detector/Low": 33, "filters/Blur/Blur size": "7"}
    live.send("restore", values={**values, "windows/path": False, "a/b": "1"})
    live.read_until(lambda: filters.current.threshold == 78)
    live.read_until(lambda: live.values["edge_detector"]["low"] == 33)
    assert filters.current.blur_size == 7
    first = live.first["filters"]
    changed = {
        name: value for name, value in live.values["filters"].items() if value != first[name]
    }
    assert changed == {"threshold": 78, "blur_size": 7}


def test_one_bad_setting_of_many_keeps_no_other_from_being_set(live, filters):
    live.send("restore", values={"filters/threshold": 999, "filters/gray": "False"})
    live.read_until(lambda: live.values["filters"]["gray"] is False)
    assert filters.current.threshold == 128
    live.read_until(lambda: live.said("filters: threshold=999: must be from 0 to 255"))


class Reading(Changing):
    """A graph with texts, which a test publishes."""

    def __init__(self):
        super().__init__()
        self.inboxes = {}

    def subscribe(self, topic, depth=1):
        self.inboxes[topic] = inbox = Inbox(lossless=False)
        self.looked_at.append(topic)
        return Subscription(topic, inbox, lambda: self.looked_at.remove(topic))

    def publish_text(self, topic, text):
        self.inboxes[topic].put(Packet(0, Text(text), 0))


def with_text(name):
    declared = NodeType(name, None, NoParams, {}, {"text": Text})
    return Node(name, declared, NoParams(), {}, {"text": f"/{name}/text"})


@pytest.fixture
def reading(port):
    runtime = Reading()
    page = Page(ViewOptions(port=port))
    page.open(runtime)
    yield runtime
    page.close()


def test_texts_are_read_only_while_somebody_reads_and_never_markup(reading, port):
    reading.show(with_text("a"), with_text("b"))
    with Live(port, NODES, VIEW_TOKEN) as live:
        live.read_until(lambda: live.state.get("graph") == ["a", "b"])
        assert not reading.looked_at
        live.send("read", topics=["/a/text", "/image_raw"])
        live.read_until(lambda: reading.looked_at == ["/a/text"])
        reading.publish_text("/a/text", "<img src=x>\n\n    a < b")
        live.read_until(lambda: live.state.get("topic") == "/a/text")
        formula = '<pre tabindex="0">a &lt; b</pre>'
        assert live.state["html"] == f"<p>&lt;img src=x&gt;</p>\n{formula}"
        live.send("read", topics=[])
        live.read_until(lambda: not reading.looked_at)
        live.send("read", topics=["/b/text"])
        live.read_until(lambda: reading.looked_at == ["/b/text"])
    with Live(port, NODES) as live:
        live.read_until(lambda: not reading.looked_at)


def test_beyond_a_slider_the_parameters_own_limits_count(live, runtime):
    assert live.set("fps_control", "fps", 120)["reason"] == ""
    assert "from 0 to 240" in live.set("fps_control", "fps", 241)["reason"]
    assert runtime.parameters["fps_control"].current.fps == 120


def test_a_graph_that_changes_is_followed(reading, port):
    with Live(port, NODES) as live:
        live.read_until(lambda: live.state.get("graph") == [])
        reading.show(make("own", "/own", find("fps_control").params))
        live.read_until(lambda: "fps" in live.values.get("own", {}))
        assert live.set("own", "fps", 7)["reason"] == ""
        reading.parameters.clear()
        reading.show(make("own", "/own", find("edge_detector").params))
        live.read_until(lambda: "low" in live.values["own"])
        reading.parameters["own"].update({"low": 44})
        live.read_until(lambda: live.values["own"]["low"] == 44)
        reading.show()
        live.read_until(lambda: live.state["graph"] == [])
        assert "no such node: own" in live.set("own", "low", 3)["reason"]


def test_graphs_that_change_fast_break_nothing(reading, port, caplog):
    nodes = [make(f"n{n}", f"/n{n}", find("fps_control").params) for n in range(4)]
    with Live(port, NODES) as live:
        for turn in range(30):
            reading.show(*[node for n, node in enumerate(nodes) if (turn >> n % 3) & 1])
            live.set(f"n{turn % 4}", "fps", turn)
        reading.show(*nodes)
        live.read_until(lambda: live.state["graph"] == ["n0", "n1", "n2", "n3"])
    assert not [record for record in caplog.records if record.exc_info]


def test_a_number_that_no_browser_can_hold_is_sent_as_text(reading, port):
    free = find("fps_control")
    reading.show(make("own", "/own", free.params))
    with Live(port, NODES) as live:
        live.read_until(lambda: "own" in live.values)
        json.dumps(live.got, allow_nan=False)


def test_warnings_of_the_log_are_seen_by_all_and_bounded(live, port):
    log = logging.getLogger("ros_visualise.test")
    for number in range(200):
        log.warning("<b>line %d", number)
    log.error("the last")
    log.error("the last")
    log.info("nothing")
    live.read_until(lambda: live.said("the last"))
    live.read_until(lambda: live.state["notices"][-1][2:] == ["error", "the last", 2])
    assert len(live.state["notices"]) == 50
    with Live(port, NODES, VIEW_TOKEN) as later:
        later.read_until(lambda: later.said("<b>line 199"))
