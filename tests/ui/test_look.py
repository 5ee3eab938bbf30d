"""What the pages for looking closely are answered, and what is refused."""

import http.client
import json
import logging
import re
from contextlib import closing

import cv2
import numpy as np
import pytest
from page_client import TOKEN
from scene_messages import odometry
from scene_runtime import Told

from ros_visualise.data import (
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    Image,
    Odometry,
    PointCloud,
)
from ros_visualise.data.reports import Level, Log
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.look import Inspector, link
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.answers import BrowserQuery, Refusal

OURS = {"X-Ros-Visualise": "1"}
DEPTH = np.array([[0.5, np.nan, 2.25], [0, 7, 1e-3]], np.float32)
DEEP = np.arange(12, dtype=np.uint16).reshape(2, 2, 3) * 5000


@pytest.fixture
def told():
    return Told(
        deep=Image, depth=Image, odom=Odometry, diagnostics=DiagnosticArray, points=PointCloud
    )


@pytest.fixture
def inspector(told):
    inspector = Inspector(told)
    yield inspector
    inspector.close()


def ask(inspector, query):
    try:
        return inspector.answer(BrowserQuery(query))
    except Refusal as refused:
        return refused.answer


def said(answer):
    return json.loads(answer.body)


@pytest.mark.parametrize(
    ("topic", "pixels", "encoding"), [("deep", DEEP, "rgb16"), ("depth", DEPTH, "32FC1")]
)
def test_pixels_come_as_they_are(told, inspector, topic, pixels, encoding):
    told.say(**{topic: Image(pixels, encoding, Header(2**62 + 1, "camera"))})
    answer = ask(inspector, f"ask=pixels&topic=/{topic}")
    facts = json.loads(answer.headers["X-Image"])
    assert (facts["encoding"], facts["width"], facts["height"]) == (encoding, *pixels.shape[1::-1])
    assert facts["stamp"] == str(2**62 + 1)
    found = np.frombuffer(answer.body, facts["dtype"]).reshape(pixels.shape)
    np.testing.assert_array_equal(found, pixels)
    again = ask(inspector, f"ask=pixels&topic=/{topic}&after={2**62 + 1}")
    assert (again.status, again.body) == (204, b"")


def test_16_bits_are_saved_as_they_are(told, inspector):
    told.say(deep=Image(DEEP, "rgb16", Header(7)))
    answer = ask(inspector, "ask=png&topic=/deep")
    read = cv2.imdecode(np.frombuffer(answer.body, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., ::-1], DEEP)
    assert 'filename="deep_7.png"' in answer.headers["Content-Disposition"]


def test_of_two_topics_the_images_of_one_stamp_are_found(told, inspector):
    def image(value):
        return Image(np.full((2, 2), value, np.uint8), "mono8", Header(value))

    assert ask(inspector, "ask=pixels&topic=/deep").status == 404  # from now on they are kept
    for value in (1, 2, 3):
        told.say(deep=image(value))
    assert ask(inspector, "ask=pixels&topic=/deep&stamp=2").body == bytes([2] * 4)
    assert ask(inspector, "ask=pixels&topic=/deep").body == bytes([3] * 4)
    assert ask(inspector, "ask=pixels&topic=/deep&stamp=9&near=1").body == bytes([3] * 4)
    assert "with that timestamp" in said(ask(inspector, "ask=pixels&topic=/deep&stamp=9"))["error"]


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("ask=pixels&topic=/odom", 404),
        ("ask=pixels&topic=/no/such", 404),
        ("ask=pixels&topic=/deep&stamp=x", 400),
        ("ask=pixels&topic=/deep&stamp=99999999999999999999", 400),
        ("ask=message&topic=/no/such", 404),
        ("ask=nothing", 404),
        ("look=../../etc/passwd", 404),
        ("ask=play&toggle=1", 409),
        ("ask=pixels&topic=%ff", 400),
        ("ask=" + "x" * 9000, 414),
    ],
)
def test_what_is_not_there_is_told(inspector, query, status):
    answer = ask(inspector, query)
    assert answer.status == status
    assert said(answer)["error"]


def test_what_is_no_question_is_for_others(inspector):
    assert ask(inspector, "ask=topics").status == 200
    assert ask(inspector, "session=1") is None


def test_who_may_only_look_changes_nothing(inspector):
    for query in ("ask=play&toggle=1", "ask=play&seek=1", "ask=play"):
        answer = inspector.answer(BrowserQuery(query), is_viewer=True)
        assert (answer.status, said(answer)["error"]) == (403, "this address is read-only")
    assert inspector.answer(BrowserQuery("ask=topics"), is_viewer=True).status == 200


def test_a_message_is_a_tree_by_its_ros_names(told, inspector):
    told.say(odom=odometry([1, 2, 3]))
    found = said(ask(inspector, "ask=message&topic=/odom"))["message"]
    assert found["pose"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert found["header"]["frame_id"] == "odom"
    status = DiagnosticStatus("motor", Level.WARN, "hot", {"C": "81"})
    told.say(diagnostics=DiagnosticArray((status,), Header(1)))
    found = said(ask(inspector, "ask=message&topic=/diagnostics"))["message"]
    assert found["status"][0]["values"] == [{"key": "C", "value": "81"}]


def test_a_long_array_is_cut_and_says_its_length(told, inspector):
    told.say(deep=Image(np.full((99, 99), 7, np.uint8), "mono8"))
    found = said(ask(inspector, "ask=message&topic=/deep"))["message"]["data"]
    assert found == {"first": [7] * 50, "length": 9801}


def test_numbers_that_are_none_are_words(told, inspector):
    told.say(odom=odometry([np.nan, np.inf, 0]))
    found = said(ask(inspector, "ask=message&topic=/odom"))["message"]["pose"]["pose"]["position"]
    assert found == {"x": "nan", "y": "inf", "z": 0.0}


def test_the_log_is_told_from_a_line_on(inspector):
    log = logging.getLogger("ros_visualise.test")
    for number in range(3):
        log.warning("line %d", number)
    lines = said(ask(inspector, "ask=log"))["lines"]
    assert [line["text"] for line in lines] == ["line 0", "line 1", "line 2"]
    after = said(ask(inspector, f"ask=log&after={lines[1]['number']}"))["lines"]
    assert [line["text"] for line in after] == ["line 2"]


def test_the_log_of_a_graph_is_told_beside_our_own(told, inspector):
    told.name = "/viewer"
    told.add("/rosout", Log)
    inspector.refresh()
    for node, text in (("/planner", "no path"), ("/viewer", "is here already")):
        told.say(rosout=Log(node, logging.ERROR, text, Header(7_500_000_000)))
    inspector.refresh()
    (line,) = said(ask(inspector, "ask=log"))["lines"]
    number = line.pop("number")
    assert line == {"time": 7.5, "level": "ERROR", "node": "/planner", "text": "no path"}
    assert number == 1


def test_diagnostics_are_the_newest_of_each_name(told, inspector):
    def say(*several):
        inspector.refresh()
        told.say(diagnostics=DiagnosticArray(several, Header(1)))
        inspector.refresh()
        return {one["name"]: one for one in said(ask(inspector, "ask=diagnostics"))["statuses"]}

    say(DiagnosticStatus("motor", Level.ERROR, "hot", {"C": "81"}))
    found = say(DiagnosticStatus("battery"), DiagnosticStatus("lidar", Level.WARN))
    assert found["motor"]["values"] == [["C", "81"]]
    assert (found["motor"]["level"], found["lidar"]["level"], found["battery"]["level"]) == (
        2,
        1,
        0,
    )
    assert found["robot"]["message"] == "OK", "our own nodes tell, too"
    assert say(DiagnosticStatus("motor", Level.OK, "cool"))["motor"]["message"] == "cool"


def test_topics_are_asked_for_only_while_somebody_looks(told):
    clock = [0.0]
    taps = Taps(told, 1, lambda: clock[0])
    taps.newest("/odom")
    assert told.asked["/odom"] == 1
    clock[0] = 4.0
    taps.rest()
    assert told.asked["/odom"] == 1
    clock[0] = 6.0
    taps.rest()
    assert told.asked["/odom"] == 0


def get(port, path, **headers):
    with closing(http.client.HTTPConnection("127.0.0.1", port, timeout=20)) as asked:
        asked.request("GET", f"/{TOKEN}{path}", headers=headers)
        answer = asked.getresponse()
        return answer.status, answer.headers, answer.read()


def test_the_door_is_before_these_pages_too(page, port):
    status, headers, body = get(port, "/" + link("image", topic="/edges"))
    assert status == 200
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert b"class Stage" in body
    assert not re.search(rb"/\* [a-z]+\.(js|css) \*/", body)  # all parts are inside
    evil = {"Host": f"127.0.0.1:{port}", "Origin": "http://evil.example"}
    assert get(port, "/?ask=topics", **OURS, **evil)[0] == 403
    assert get(port, "/other?ask=topics", **OURS)[0] == 404


DIFFERENCE = """() => {
  const facts = { width: 1, height: 1, channels: 3, dtype: "uint8", measured: false, stamp: "1" };
  const made = (encoding, ...values) =>
    new Picture("/image", { ...facts, encoding }, new Uint8Array(values).buffer);
  return difference(made("rgb8", 10, 20, 30), made("bgr8", 33, 20, 7)).at(0, 0);
}"""


def test_a_click_on_an_image_opens_it_with_its_values(browse, runtime):
    tab = browse()
    shown = tab.locator("[data-images] canvas").first.bounding_box()
    with tab.context.expect_page(timeout=60_000) as opened:
        tab.mouse.click(shown["x"] + shown["width"] / 2, shown["y"] + shown["height"] / 2)
    whole = opened.value
    whole.locator("#facts", has_text="640").wait_for(timeout=60_000)
    whole.select_option("#other", "/processed_image")
    canvas = whole.locator("#view")
    box = canvas.bounding_box()
    canvas.hover(position={"x": box["width"] / 2, "y": box["height"] / 2})
    whole.locator("#value", has_text="/processed_image").wait_for(timeout=30_000)
    text = whole.locator("#value").inner_text()
    x, y = map(int, re.search(r"x (\d+), y (\d+)", text).groups())
    subscription = runtime.subscribe("/image_raw")
    values = subscription.take(10).pixels[y, x].tolist()
    subscription.close()
    assert [int(v) for v in re.findall(r"[RGB] (\d+)", text)] == values
    assert whole.evaluate(DIFFERENCE) == [3, 0, 3]


def test_who_asks_before_anything_is_shown_is_told_to_ask_again(port):
    early = Page(ViewOptions(port=port))
    try:
        for asked in ("/?ask=topics", "/?look=plots"):
            status, _, body = get(port, asked, **OURS)
            assert (status, "try again" in json.loads(body)["error"]) == (503, True)
    finally:
        early.close()
