"""The 3D view as browsers are told of it over their WebSockets."""

from contextlib import closing

import numpy as np
import pytest
from page_client import TOKEN, VIEW_TOKEN
from scene_messages import LEFT, cloud, image, odometry, tf, transform
from scene_runtime import Told
from space_client import SpaceClient
from waiting import wait_for

from ros_visualise.data import Image, Odometry, PointCloud, PoseStamped, Transforms
from ros_visualise.ui.live.space.nodes import Points
from ros_visualise.ui.page.server import PageServer
from ros_visualise.ui.server.access import access_rules

POINTS = np.array([[0.0, 0, 5]] * 9)
ROBOT = {"tf": Transforms, "tf_static": Transforms, "points": PointCloud, "odom": Odometry}


@pytest.fixture
def runtime():
    return Told(inputs={"goal": PoseStamped}, **ROBOT, image=Image)


@pytest.fixture
def hub(port, runtime):
    server = PageServer("127.0.0.1", port, "test", access_rules("127.0.0.1"))
    server.space.show(runtime)
    yield server.space
    server.close()


@pytest.fixture
def browse(port, hub):
    clients = []

    def connect(token=TOKEN, **options):
        clients.append(SpaceClient(port, token, **options))
        return clients[-1]

    yield connect
    for client in clients:
        client.close()


def robot_at(runtime, x):
    runtime.say(tf=tf(transform("odom", "base_link", [x, 0, 0], 1 + x)))


def test_what_is_published_is_drawn_for_all_browsers_and_for_late_ones(browse, runtime):
    first = browse()
    runtime.say(tf_static=tf(transform("base_link", "lidar", [0, 0, 1])))
    robot_at(runtime, 3)
    first.read_until(lambda: runtime.asked["/points"] == 1)
    runtime.say(points=cloud(POINTS, stamp_s=4), odom=odometry([3, 0, 0]))
    for client in (first, browse()):
        nodes = client.nodes
        client.read_until(lambda nodes=nodes: nodes.get("/world/topics/odom/axes"))
        client.read_until(
            lambda nodes=nodes: len(nodes["/world/topics/points/points"]["points"]) == 9
        )
        assert nodes["/world/topics/points"]["position"].tolist() == [3, 0, 1]
        assert nodes.above["/world/topics/points/points"] == "/world/topics/points"
        client.read_until(lambda client=client: client.state.get("fixed") == "odom")


def test_only_transforms_are_asked_for_while_nobody_looks(browse, hub, runtime):
    wait_for(lambda: runtime.asked["/tf"] == 1)
    runtime.say(tf_static=tf(transform("map", "lidar", [1, 0, 0])))
    runtime.say(tf_static=tf(transform("map", "odom", [2, 0, 0])), points=cloud(POINTS))
    wait_for(lambda: hub.scene.frames.names == ["lidar", "map", "odom"])
    assert [runtime.asked[topic] for topic in ("/points", "/odom", "/image")] == [0, 0, 0]
    client = browse()
    wait_for(lambda: runtime.asked["/points"] == 1)
    client.read_until(lambda: "/world/topics/points/points" in client.nodes)
    client.close()
    wait_for(lambda: sum(runtime.asked[t] for t in ("/points", "/odom", "/image")) == 0)
    assert runtime.asked["/tf"] == 1


def test_a_hidden_topic_is_not_asked_for(browse, runtime):
    client = browse()
    client.read_until(lambda: runtime.asked["/points"] == 1)
    client.set("3d/legend//points", False)
    client.read_until(lambda: runtime.asked["/points"] == 0)
    client.set("3d/legend//points", True)
    client.read_until(lambda: runtime.asked["/points"] == 1)


def test_a_moved_node_is_moved_and_not_made_anew(browse, runtime):
    client = browse()
    for x in range(5):
        robot_at(runtime, x)
        runtime.say(odom=odometry([x, 0, 0], 1 + x))
        client.read_until(lambda: "/world/topics/odom/axes" in client.nodes)
        client.read_until(lambda x=x: client.nodes["/world/topics/odom/axes"]["position"][0] == x)
    assert len(client.nodes.made) == len(set(client.nodes.made))


def test_settings_are_shared_and_wrong_ones_are_answered(browse, hub, runtime):
    one, other = browse(), browse()
    runtime.say(tf=tf(transform("map", "odom", [1, 0, 0], 1)))
    one.read_until(lambda: one.state and one.state["fixed"] == "map")
    assert "Shown in map" in one.state["notes"]
    one.set("3d/fixed frame", "odom")
    one.set("3d/appearance/point size", 0.3)
    one.set("3d/legend/colour by", "Height")
    changed = {
        "3d/fixed frame": "odom",
        "3d/appearance/point size": 0.3,
        "3d/legend/colour by": "Height",
    }
    other.read_until(lambda: other.state and other.state["changed"] == changed)
    assert other.state["fixed"] == "odom"
    assert hub.arrangement == changed
    for place, value in [
        ("3d/appearance/point size", 1e300),
        ("3d/appearance/point size", "NaN"),
        ("3d/appearance/max points", [1]),
        ("3d/appearance/frame axes", 7),
        ("3d/fixed frame", {"a": 1}),
        ("3d/legend//nothing", True),
        ("x" * 5000, True),
    ]:
        one.said.clear()
        one.send({"set": {place: value}})
        one.read_until(lambda: one.said)
        assert len(one.said[0]) < 300
    assert hub.arrangement == changed
    one.set("3d/fixed frame", "auto")
    one.read_until(lambda: one.state["fixed"] == "map")


def test_saved_settings_are_applied_and_survive_another_graph(browse, hub):
    saved = {"3d/appearance/axes size": 2.0, "3d/legend//points": False, "view": "1,2,3,4,5,6"}
    hub.apply(saved | {"3d/fixed frame": "nowhere", "3d/appearance/point size": "0.06"})
    hub.show(Told(**ROBOT))
    client = browse()
    client.read_until(lambda: client.state and client.state["changed"])
    expected = {"3d/appearance/axes size": 2.0, "3d/legend//points": False}
    assert hub.arrangement == expected | {"view": "1.00,2.00,3.00,4.00,5.00,6.00"}
    client.send({"view": [9, 8, 7, 0, 0, 0]})
    wait_for(lambda: hub.arrangement.get("view") == "9.00,8.00,7.00,0.00,0.00,0.00")
    client.send({"home": 1})
    wait_for(lambda: "view" not in hub.arrangement)


def test_a_slow_browser_gets_the_newest_state_and_no_queue(browse, hub, runtime):
    slow, fast = browse(is_slow=True), browse()
    for x in range(40):
        robot_at(runtime, x)
        runtime.say(odom=odometry([x, 0, 0], 1 + x))
        fast.read_until(
            lambda x=x: fast.nodes.get("/world/topics/odom/axes", {}).get("position", [-1])[0] == x
        )
    for _ in range(20):
        slow.read(0.05)
    assert slow.packets == 2
    slow.got()
    slow.read_until(lambda: slow.packets == 3)
    assert slow.nodes["/world/topics/odom/axes"]["position"][0] == 39
    assert len(slow.nodes["/world/topics/odom/trail"]["points"]) >= 39


def test_nodes_that_come_and_go_leave_nothing(browse, hub):
    client = browse()
    client.read_until(lambda: "/world/grid" in client.nodes)
    for number in range(200):
        hub.tree.add(f"/world/{number}", Points()).remove()
    last = hub.tree.add("/world/last", Points())
    client.read_until(lambda: "/world/last" in client.nodes)
    last.remove()
    client.read_until(lambda: "/world/last" not in client.nodes)
    assert not [name for name in client.nodes if name[-1].isdigit()]
    hub.tree.add("/world/more", Points())
    client.read_until(lambda: "/world/more" in client.nodes)


def test_too_much_is_reported_and_the_rest_is_drawn(browse, hub, runtime):
    client = browse()
    client.read_until(lambda: runtime.asked["/points"] == 1)
    hub.tree._max_bytes = 20_000
    runtime.say(odom=odometry([1, 0, 0]), points=cloud(np.ones((9000, 3)), "odom"))
    line = "1 changes rejected: the 3D view is full"
    client.read_until(lambda: line in client.state.get("notes", ()))
    assert any(line.startswith("/points: ") for line in client.state["notes"])
    assert [line.partition(": ")[0] for line in client.state["missing"]] == ["/points"]
    client.read_until(lambda: client.nodes.get("/world/topics/odom/axes", {}).get("visible"))


def test_foreign_messages_change_nothing_and_end_nothing(browse, hub, runtime):
    client = browse()
    for text in [
        "",
        "{}",
        "[]",
        "null",
        "7",
        "{" * 10_000,
        '{"got": [1]}',
        '{"pick": 1}',
        '{"pick": {"ray": [0, 0, 0, 0, 0, 0], "id": 1}}',
        '{"pick": {"ray": [1e999, 0, 0, 0, 0, 1], "id": 1}}',
        '{"pick": {"ray": [0, 0, 0, 0, 0], "id": 1}}',
        '{"view": [1, 2]}',
        '{"view": "abcdef"}',
        '{"set": []}',
        '{"set": {}}',
        '{"other": 1}',
    ]:
        client.send(text)
    runtime.say(odom=odometry([1, 0, 0]))
    client.read_until(lambda: "/world/topics/odom/axes" in client.nodes)
    assert not hub.arrangement
    assert not client.picked


def test_clicks_are_answered_with_places(browse, runtime):
    client = browse()
    robot_at(runtime, 3)
    client.read_until(lambda: runtime.asked["/points"] == 1)
    runtime.say(odom=odometry([3, 0, 0]), points=cloud([[7, 0, 1]], "odom"))
    client.read_until(lambda: client.nodes.get("/world/topics/points", {}).get("visible"))
    for ray, at in [([7, 0, 9, 0, 0, -1], [7, 0, 1]), ([2, 3, 9, 0, 0, -4], [2, 3, 0])]:
        client.picked.clear()
        client.send({"pick": {"ray": ray, "id": 5}})
        client.read_until(lambda: client.picked)
        assert client.picked == [{"id": 5, "at": at, "fixed": "odom", "goal": ""}]
    client.send({"pick": {"ray": [0, 0, 1, 0, 0, 1], "id": 6}})
    client.read_until(lambda: client.picked[-1]["at"] is None)


def test_a_click_sends_a_goal_that_looks_ahead(browse, runtime):
    client = browse()
    client.read_until(lambda: client.state and client.state["goals"] == ["/goal"])
    runtime.say(tf=tf(transform("map", "base_link", [3, 0, 0], 4)))
    runtime.say(odom=odometry([3, 0, 0], 4, "map"))
    client.read_until(lambda: len(client.nodes["/view"]["robot"]))
    client.send({"pick": {"ray": [3, 5, 9, 0, 0, -1], "id": 1, "goal": "/goal"}})
    client.read_until(lambda: client.picked)
    topic, goal = runtime.taken[-1]
    assert (topic, goal.header.frame_id) == ("/goal", "map")
    assert np.allclose(goal.position_xyz, [3, 5, 0])
    assert np.allclose(goal.quat_xyzw, LEFT)
    client.send({"pick": {"ray": [3, 5, 9, 0, 0, -1], "id": 1, "goal": "/odom"}})
    client.read_until(lambda: client.said)
    assert len(runtime.taken) == 1


def test_a_viewer_changes_its_own_view_alone(browse, hub, runtime):
    viewer, owner = browse(VIEW_TOKEN), browse()
    viewer.read_until(lambda: viewer.controls)
    viewer.set("3d/appearance/axes size", 3.0)
    viewer.send({"view": [1, 2, 3, 4, 5, 6]})
    viewer.send({"pick": {"ray": [0, 0, 9, 0, 0, -1], "id": 2, "goal": "/goal"}})
    viewer.read_until(lambda: viewer.picked)
    assert viewer.picked[0]["goal"] == ""
    viewer.send({"home": 1})
    owner.set("3d/appearance/axes size", 2.0)  # is done after all that
    viewer.read_until(lambda: viewer.state["changed"])
    assert hub.arrangement == {"3d/appearance/axes size": 2.0}
    assert not runtime.taken


def test_a_graph_without_a_scene_has_none(browse, hub):
    client = browse()
    client.read_until(lambda: client.state and client.state["has"])
    hub.show(Told(image=Image))
    client.read_until(lambda: not client.state["has"])
    empty = {"/world", "/world/grid", "/view", "/world/axes"}
    client.read_until(lambda: set(client.nodes) == empty)
    hub.show(None)
    client.read_until(lambda: not client.nodes and not client.state)
    hub.show(Told(**ROBOT))
    client.read_until(lambda: client.state and client.state["has"])


def test_an_image_is_taken_for_its_frustum(browse, runtime):
    client = browse()
    runtime.say(tf=tf(transform("map", "camera", [0, 0, 1], 1)))
    client.read_until(lambda: runtime.asked["/image"] == 1)
    runtime.say(image=image())
    client.read_until(lambda: "/world/topics/image/camera" in client.nodes)


def test_many_browsers_come_and_go(port, hub, browse):
    for _ in range(20):
        with closing(browse()) as client:
            client.read_until(lambda client=client: "/world/grid" in client.nodes)
    wait_for(lambda: not hub.is_watched)
