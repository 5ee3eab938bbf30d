"""Messages as browsers get them: the newest as a tree, those before it, tables of fields."""

import numpy as np
import pytest
from hub_client import HubClient
from scene_messages import odometry
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.data import DiagnosticArray, DiagnosticStatus, Header, Image, Odometry
from ros_visualise.data.reports import Level
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.ui.live.messages import MessageHub
from ros_visualise.ui.live.taps import Taps
from ros_visualise.ui.live.trees import fields_of

X = "pose.pose.position.x"


@pytest.fixture
def told():
    return Told(odom=Odometry, image=Image, diagnostics=DiagnosticArray)


@pytest.fixture
def client(told):
    hub = MessageHub()
    hub.show(told)
    with HubClient(hub, is_viewer=True) as client:
        yield client
    hub.close()


def message_of(client, topic, **asked):
    client.send(topic=topic, **asked)
    return client.read_until(lambda one: one.get("topic") == topic and "message" in one)


def test_topics_are_offered(client):
    assert client.read()["topics"]["/odom"] == "nav_msgs/msg/Odometry"


def test_a_message_is_a_tree_by_its_ros_names(told, client):
    told.say(odom=odometry([1, 2, 3]))
    found = message_of(client, "/odom")["message"]
    assert found["pose"]["pose"]["position"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert found["header"]["frame_id"] == "odom"
    status = DiagnosticStatus("motor", Level.WARN, "hot", {"C": "81"})
    told.say(diagnostics=DiagnosticArray((status,), Header(2**60 + 1)))
    found = message_of(client, "/diagnostics")
    assert found["message"]["status"][0]["values"] == [{"key": "C", "value": "81"}]
    assert found["stamp"] == str(2**60 + 1)


def test_a_long_array_is_cut_and_says_its_length(told, client):
    told.say(image=Image(np.full((99, 99), 7, np.uint8), "mono8"))
    assert message_of(client, "/image")["message"]["data"] == {"first": [7] * 50, "length": 9801}


def test_numbers_that_are_none_are_words(told, client):
    told.say(odom=odometry([np.nan, np.inf, 0]))
    found = message_of(client, "/odom")["message"]["pose"]["pose"]["position"]
    assert found == {"x": "nan", "y": "inf", "z": 0.0}


def test_earlier_messages_are_there_and_a_table_of_their_fields(told, client):
    told.say(odom=odometry([0, 0, 0], 0))
    message_of(client, "/odom")
    for second in range(1, 300):
        told.say(odom=odometry([second, 0, 0], second))
    found = client.read_until(lambda one: one.get("message", {}).get("header", {}))
    while found["last"] < 200:
        found = client.read_until(lambda one: "message" in one)
    assert found["last"] - found["first"] == 199
    found = message_of(client, "/odom", number=found["first"], fields=[X, "no", 5])
    newest, oldest = found["rows"][0], found["rows"][-1]
    assert newest[2:] == [299, "nan"]
    assert oldest[0] == found["number"] == found["first"]
    assert oldest[2] == found["message"]["pose"]["pose"]["position"]["x"]
    assert message_of(client, "/odom", number=10**9)["number"] == found["last"]


def test_topics_are_subscribed_to_only_while_somebody_looks(told):
    hub = MessageHub()
    hub.show(told)
    with HubClient(hub) as client:
        client.send(topic="/odom")
        wait_for(lambda: told.asked["/odom"] == 1)
        client.send(topic="/image")
        wait_for(lambda: (told.asked["/odom"], told.asked["/image"]) == (0, 1))
    assert told.asked["/image"] == 0
    hub.close()


def test_topics_are_tapped_for_some_seconds(told, clock):
    taps = Taps(told, clock)
    told.say(odom=odometry([1, 2, 3]))
    assert taps.newest("/odom").header.frame_id == "odom"
    clock.now_s = 4.0
    taps.rest()
    assert told.asked["/odom"] == 1
    clock.now_s = 6.0
    taps.rest()
    assert told.asked["/odom"] == 0


def test_a_damaged_message_is_reported(told, client):
    definitions = Definitions("cdr")
    told.say(odom=Recorded("nav_msgs/msg/Odometry", b"\x00\x01\x00\x00abc", definitions, 7))
    client.send(topic="/odom")
    assert "Odometry" in client.read_until(lambda one: "error" in one)["error"]


def test_fields_are_called_as_in_the_ros_type():
    fields = fields_of(odometry([1, 2, 3], 1.5))
    assert fields["pose.pose.position.y"] == 2
    assert fields["header.stamp"] == 1.5


def test_messages_of_types_that_nobody_knows_have_fields():
    definitions = Definitions("cdr")
    definitions.define("my_msgs/msg/Battery", "float32 voltage\nuint8[3] cells\nstring name\n")
    battery = definitions.types["my_msgs/msg/Battery"](12.5, np.array([1, 2, 3], np.uint8), "a")
    data = definitions.write("my_msgs/msg/Battery", battery)
    fields = fields_of(Recorded("my_msgs/msg/Battery", data, definitions, 7))
    assert fields == {"voltage": 12.5, "cells[0]": 1, "cells[1]": 2, "cells[2]": 3}


@pytest.mark.parametrize(
    "text",
    [
        *("", "x", "[]", "null", "[" * 50_000, '{"topic": 1}', '{"topic": "/no"}', "\x00"),
        '{"topic": "/odom", "number": "x", "fields": 5}',
        '{"topic": "/odom", "number": true, "fields": [null, "", "]", "a[99999999999]"]}',
        '{"topic": "/odom", "number": 1%s}' % ("0" * 400),
    ],
)
def test_nonsense_ends_nothing(told, client, text):
    client.send(text)
    told.say(odom=odometry([1, 2, 3]))
    assert message_of(client, "/odom")["number"] == 1
