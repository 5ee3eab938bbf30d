"""What the pages for looking closely are answered, and what is refused."""

import http.client
import json
import logging
import re
from contextlib import closing

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
from ros_visualise.ui.look import Inspector
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.answers import BrowserQuery, Refusal

OURS = {"X-Ros-Visualise": "1"}


@pytest.fixture
def told():
    return Told(deep=Image, odom=Odometry, diagnostics=DiagnosticArray, points=PointCloud)


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
    ("query", "status"),
    [
        ("ask=log&after=x", 400),
        ("ask=log&after=99999999999999999999", 400),
        ("ask=message&topic=/no/such", 404),
        ("ask=nothing", 404),
        ("look=../../etc/passwd", 404),
        ("ask=play&toggle=1", 409),
        ("ask=message&topic=%ff", 400),
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
    status, headers, body = get(port, "/?look=messages&topic=/edges")
    assert status == 200
    assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
    assert b"async function ask(" in body
    assert not re.search(rb"/\* [a-z]+\.(js|css) \*/", body)  # all parts are inside
    evil = {"Host": f"127.0.0.1:{port}", "Origin": "http://evil.example"}
    assert get(port, "/?ask=topics", **OURS, **evil)[0] == 403
    assert get(port, "/other?ask=topics", **OURS)[0] == 404


def test_who_asks_before_anything_is_shown_is_told_to_ask_again(port):
    early = Page(ViewOptions(port=port))
    try:
        for asked in ("/?ask=topics", "/?look=plots"):
            status, _, body = get(port, asked, **OURS)
            assert (status, "try again" in json.loads(body)["error"]) == (503, True)
    finally:
        early.close()
