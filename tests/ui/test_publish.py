"""Publishing messages from a form, in a hub of its own and in a real browser."""

import math

import numpy as np
import pytest
from hub_client import HubClient
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scene_runtime import Told
from waiting import wait_for

from ros_visualise.core.errors import DamagedMessage, UsageError
from ros_visualise.data import PoseStamped, Twist
from ros_visualise.messages.filling import described, fill, plain
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live.publish import PublishHub
from ros_visualise.ui.page import Page
from ros_visualise.ui.server.host import page_loop

STORE = get_typestore(Stores.ROS2_JAZZY)
TWIST, POSE = "geometry_msgs/msg/Twist", "geometry_msgs/msg/PoseStamped"
SLOW = {"linear": {"x": 0.25}}


@pytest.fixture
def told():
    return Told({"cmd_vel": Twist, "goal": PoseStamped})


@pytest.fixture
def hub(told):
    found = PublishHub(page_loop(), pytest.fail, is_allowed=True)
    found.show(told)
    yield found
    found.close()


def news(client, key):
    """The value of a key in the next message that has it."""
    message = client.read_until(lambda all_: any(key in one for one in all_))
    return next(one[key] for one in message if key in one)


def publish(client, topic="/cmd_vel", type=TWIST, values=SLOW, rate=0, panel="a"):
    client.send(do="publish", panel=panel, topic=topic, type=type, values=values, rate=rate)


def test_a_message_is_published_once(hub, told):
    with HubClient(hub) as client:
        assert news(client, "topics") == {"/cmd_vel": TWIST, "/goal": POSE}
        publish(client)
        assert news(client, "count") == 1
        publish(
            client, "/goal", POSE, {"header": {"frame_id": "map"}, "pose": {"position": {"y": 2}}}
        )
        assert news(client, "count") == 1
    (_, twist), (_, goal) = [(topic, one.content) for topic, one in told.taken]
    assert twist.linear_xyz.tolist() == [0.25, 0, 0]
    assert (goal.header.frame_id, goal.position_xyz.tolist()) == ("map", [0, 2, 0])
    assert goal.header.stamp_ns > 10**18


def test_a_rate_ends_with_a_stop_and_when_the_browser_leaves(hub, told):
    with HubClient(hub) as client:
        publish(client, rate=50)
        client.read_until(lambda all_: any(one.get("count", 0) >= 3 for one in all_))
        client.send(do="stop", panel="a")
        client.send(do="describe", type=TWIST)
        news(client, "fields")
        assert not hub._repeated
        publish(client, rate=50)
        wait_for(lambda: hub._repeated)  # a count may still be of the first ones
    wait_for(lambda: not hub._repeated)


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"values": {"linear": {"x": "1"}}}, "linear.x: must be a number"),
        ({"values": {"linear": {"w": 1}}}, "no field 'w'"),
        ({"values": {"linear": 5}}, "must be an object"),
        ({"topic": "/other"}, "no node subscribes to it"),
        ({"type": POSE}, "/cmd_vel is of type geometry_msgs/msg/Twist"),
        ({"topic": "cmd_vel"}, "invalid topic"),
        ({"rate": 1e9}, "invalid topic, rate or values"),
        ({"values": [1]}, "invalid topic, rate or values"),
    ],
)
def test_what_does_not_fit_is_rejected(hub, told, given, problem):
    with HubClient(hub) as client:
        publish(client, **given)
        assert problem in news(client, "problem")
        publish(client)
        assert news(client, "count") == 1
    assert len(told.taken) == 1


def test_a_failure_of_the_graph_ends_the_rate(hub, told):
    def fail(topic, message):
        raise UsageError("no such luck")

    told.publish = fail
    with HubClient(hub) as client:
        publish(client, rate=10)
        assert news(client, "problem") == "no such luck"
        assert not hub._repeated


def test_any_topic_of_any_type_where_the_graph_allows_it(hub, told):
    told.publishes = True
    with HubClient(hub) as client:
        assert "sensor_msgs/msg/Image" in news(client, "types")
        client.send(do="describe", type="sensor_msgs/msg/Imu")
        fields = {one["name"]: one for one in news(client, "fields")}
        assert fields["orientation_covariance"]["value"] == [0.0] * 9
        publish(client, "/new", "std_msgs/msg/Int8", {"data": 7})
        assert news(client, "count") == 1
        client.send(do="describe", type="sensor_msgs/msg/Imo")
        assert "unknown type 'sensor_msgs/msg/Imo'" in news(client, "problem")
    assert told.taken[0][1].message.data == 7


def test_viewers_and_pages_without_control_publish_nothing(hub, told):
    closed = PublishHub(page_loop(), pytest.fail, is_allowed=False)
    closed.show(told)
    with HubClient(hub, is_viewer=True) as viewer, HubClient(closed) as client:
        publish(viewer)
        publish(client)
        assert "--allow-control" in news(client, "reason")
        with HubClient(hub) as other:  # whose request comes after theirs
            publish(other)
            news(other, "count")
    closed.close()
    assert len(told.taken) == 1


def test_long_arrays_take_no_memory_until_they_are_filled():
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("uint8[10000000] pixels", "a/msg/Large"))
    [field] = described(store, "a/msg/Large")
    assert field == {"name": "pixels", "type": "uint8[10000000]", "value": []}
    assert fill(store, "a/msg/Large", {}).pixels.nbytes == 10_000_000


@pytest.mark.parametrize("name", sorted(STORE.fielddefs))
def test_every_type_of_ros_can_be_filled(name):
    assert isinstance(described(STORE, name), list)
    message = fill(STORE, name, {})
    assert STORE.deserialize_cdr(STORE.serialize_cdr(message, name), name) is not None
    again = fill(STORE, name, plain(message))
    assert bytes(STORE.serialize_cdr(again, name)) == bytes(STORE.serialize_cdr(message, name))


@pytest.mark.parametrize(
    ("type_name", "values", "found"),
    [
        ("std_msgs/msg/UInt8", {"data": 255}, 255),
        ("std_msgs/msg/UInt8", {"data": 3.0}, 3),
        ("std_msgs/msg/Float32", {"data": None}, None),
        ("std_msgs/msg/Float64", {"data": "-inf"}, -math.inf),
        ("std_msgs/msg/Bool", {"data": 1}, True),
        ("std_msgs/msg/UInt8MultiArray", {"data": "AQI="}, [1, 2]),
        ("std_msgs/msg/Float32MultiArray", {"data": [1, 2.5]}, [1, 2.5]),
    ],
)
def test_values(type_name, values, found):
    data = fill(STORE, type_name, values).data
    if found is None:
        assert math.isnan(data)
    else:
        assert (data.tolist() if isinstance(data, np.ndarray) else data) == found


@pytest.mark.parametrize(
    ("type_name", "values", "problem"),
    [
        ("std_msgs/msg/UInt8", {"data": 256}, "from 0 to 255"),
        ("std_msgs/msg/UInt8", {"data": 1.5}, "whole number"),
        ("std_msgs/msg/Float32", {"data": 1e300}, "must be a number"),
        ("std_msgs/msg/Bool", {"data": "yes"}, "true or false"),
        ("std_msgs/msg/String", {"data": 1}, "must be a string"),
        ("std_msgs/msg/UInt8MultiArray", {"data": "a"}, "base64"),
        ("sensor_msgs/msg/Imu", {"orientation_covariance": [1]}, "9 elements"),
        ("nav_msgs/msg/Path", {"poses": [{}, {"pose": 1}]}, r"poses\[1\].pose: must be an object"),
    ],
)
def test_values_that_do_not_fit(type_name, values, problem):
    with pytest.raises(DamagedMessage, match=problem):
        fill(STORE, type_name, values)


def test_the_form(chromium, told, port):
    page = Page(ViewOptions(port=port, control=True))
    page.open(told)
    context = chromium.new_context(viewport={"width": 1280, "height": 720})
    try:
        tab = context.new_page()
        tab.goto(page.url + "?layout={~panel~:~publish~}")
        tab.get_by_label("Topic", exact=True).fill("/cmd_vel")
        tab.keyboard.press("Enter")
        field = tab.get_by_label("linear.x")
        field.fill("half")
        assert tab.get_by_role("button", name="Publish once").is_disabled()
        field.fill("0.5")
        tab.get_by_role("button", name="Publish once").click()
        tab.get_by_text("1 message published").wait_for()
        field.fill("[1]")
        tab.get_by_role("button", name="Publish once").click()
        tab.get_by_text("linear.x: must be a number").wait_for()
        tab.wait_for_url("**linear.x**")  # the address holds the form
        tab.goto(page.view_url + "?layout={~panel~:~publish~}")
        tab.get_by_text("This page is read-only.").wait_for()
    finally:
        context.close()
        page.close()
    [(topic, message)] = told.taken
    assert (topic, message.content.linear_xyz[0]) == ("/cmd_vel", 0.5)
