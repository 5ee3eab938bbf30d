"""Log and diagnostics as browsers get them."""

import logging

import pytest
from hub_client import HubClient
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header
from ros_visualise.data.reports import Level, Log
from ros_visualise.ui.live.monitor import MonitorHub


@pytest.fixture
def told():
    told = Told(diagnostics=DiagnosticArray)
    told.name = "/viewer"
    told.add("/rosout", Log)
    return told


@pytest.fixture
def hub(told):
    hub = MonitorHub()
    hub.show(told)
    wait_for(lambda: told.asked["/rosout"] == told.asked["/diagnostics"] == 1)
    yield hub
    hub.close()


def lines(client, count):
    found = []
    while len(found) < count:
        found += client.read_until(lambda one: "lines" in one)["lines"]
    return found


def test_the_log_is_whole_for_each_browser_and_then_grows(hub):
    log = logging.getLogger("ros_visualise.test")
    for number in range(3):
        log.warning("line %d", number)
    with HubClient(hub, is_viewer=True) as client:
        client.send(show="log")
        found = lines(client, 3)
        assert [line["text"] for line in found] == ["line 0", "line 1", "line 2"]
        log.error("<b>more</b>")
        (line,) = lines(client, 1)
        assert (line["text"], line["level"], line["number"]) == ("<b>more</b>", "ERROR", 4)


def test_the_log_of_a_graph_is_beside_our_own(hub, told):
    for node, text in (("/planner", "no path"), ("/viewer", "is here already")):
        told.say(rosout=Log(node, logging.ERROR, text, Header(7_500_000_000)))
    with HubClient(hub) as client:
        client.send(show="log")
        (line,) = lines(client, 1)
    assert line.pop("number") == 1
    assert line == {"time": 7.5, "level": "ERROR", "node": "/planner", "text": "no path"}


def test_diagnostics_are_the_newest_of_each_name(hub, told):
    told.say(
        diagnostics=DiagnosticArray((DiagnosticStatus("motor", Level.ERROR, "hot", {"C": "81"}),))
    )
    told.say(diagnostics=DiagnosticArray((DiagnosticStatus("lidar", Level.WARN),)))
    with HubClient(hub) as client:

        def found(name, check):
            def holds(message):
                by_name = {one["name"]: one for one in message.get("statuses", ())}
                return name in by_name and check(by_name[name])

            message = client.read_until(holds)
            return next(one for one in message["statuses"] if one["name"] == name)

        client.send(show="diagnostics")
        assert found("motor", bool)["values"] == [["C", "81"]]
        assert found("lidar", bool)["level"] == 1
        told.say(diagnostics=DiagnosticArray((DiagnosticStatus("motor", Level.OK, "cool"),)))
        assert found("motor", lambda one: one["level"] == 0)["message"] == "cool"


def test_our_own_nodes_have_diagnostics():
    hub = MonitorHub()
    hub.show(Told())
    with HubClient(hub) as client:
        client.send(show="diagnostics")
        found = client.read_until(lambda one: one["statuses"])
    assert [(one["name"], one["message"]) for one in found["statuses"]] == [("robot", "OK")]
    hub.close()


def test_another_graph_is_followed(hub, told):
    hub.show(None)
    wait_for(lambda: told.asked["/rosout"] == 0)


@pytest.mark.parametrize(
    "text", ["", "x", "[]", "null", "[" * 50_000, '{"show": 1}', '{"show": "x"}', '{"show": []}']
)
def test_nonsense_ends_nothing(hub, text):
    with HubClient(hub) as client:
        client.send(text)
        client.send(show="diagnostics")
        assert client.read()["live"]


def test_a_bug_ends_the_connection_and_is_raised(hub, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(hub.lines, "after", fail)
    client = HubClient(hub)
    client.send(show="log")
    with pytest.raises(ZeroDivisionError):
        client._serving.result(60)
