"""Driving a robot from the page, and asking nodes to do something."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from page_client import VIEW_TOKEN, Live

from ros_visualise.data import Odometry, Twist
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.pipelines import simulation_pipeline
from ros_visualise.nodes import NoParams, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.live import robot as live_robot
from ros_visualise.ui.live.robot import velocity_topic
from ros_visualise.ui.page import Page


def graph_of(robot: str) -> Graph:
    whole = simulation_pipeline(robot, camera=False, lidar=False, world="plane")
    return Graph(whole.source, tuple(node for node in whole.nodes if node.name == "path"))


ROBOT, NODES = "/live/robot", "/live/nodes"


class Hold:
    """A press of buttons that is told again with each call, as a browser does."""

    presses = 0

    def __init__(self, client: Live, names: str, **speeds: float) -> None:
        Hold.presses += 1
        self._client, self._press, self._names = client, str(Hold.presses), names.split()
        self._speeds = speeds

    def __call__(self) -> bool:
        self._client.send("hold", press=self._press, names=self._names, **self._speeds)
        return True

    def release(self) -> None:
        self._names = []
        self()

    def stop(self) -> None:
        self._client.send("stop", press=self._press)


class Told:
    """A runtime that tells what it was asked for."""

    def __init__(self, runtime: LocalRuntime) -> None:
        self._runtime = runtime
        self.velocities: list[tuple[float, ...]] = []
        self.actions: list[tuple[str, str]] = []

    def __getattr__(self, name):
        return getattr(self._runtime, name)

    def publish(self, topic, message):
        self.velocities.append((*message.linear_xyz[[0, 2]].tolist(), message.angular_xyz[2]))
        self._runtime.publish(topic, message)

    def act(self, node, action):
        self.actions.append((node, action))
        self._runtime.act(node, action)


@pytest.fixture
def husky(port) -> Iterator[Told]:
    running = LocalRuntime(graph_of("husky"), Playback(hold=True))
    told = Told(running)
    page = Page(ViewOptions(port=port))
    page.open(told)
    running.start()
    yield told
    page.close()
    running.stop()


def test_an_action_of_the_robot_ends_the_driving(port):
    running = LocalRuntime(graph_of("quadrotor"), Playback(hold=True))
    told, page = Told(running), Page(ViewOptions(port=port))
    page.open(told)
    running.start()
    client, nodes = Live(port, ROBOT), Live(port, NODES)
    try:
        client.read_until(lambda: client.state.get("moves"))
        truth = told.subscribe("/ground_truth/odom")
        hold = Hold(client, "down")
        client.read_until(lambda: hold() and len(told.velocities) > 2)
        nodes.send("act", node="path", action="clear")
        client.read_until(lambda: hold() and told.actions == [("path", "clear")])
        before = len(told.velocities)
        client.read_until(lambda: hold() and len(told.velocities) > before + 1)
        client.send("act", action="take_off")
        client.read_until(lambda: truth.take(10).position_xyz[2] > 1.0)
        after = told.velocities[told.velocities.index((0.0, 0.0, 0.0)) :]
        assert after == [(0.0, 0.0, 0.0)], "one that stops it, then none any more"
    finally:
        client.__exit__()
        nodes.__exit__()
        page.close()
        running.stop()


@pytest.fixture
def client(husky, port) -> Iterator[Live]:
    with Live(port, ROBOT) as client:
        client.read_until(lambda: client.state.get("moves"))
        yield client


@pytest.fixture
def nodes(husky, port) -> Iterator[Live]:
    with Live(port, NODES) as nodes:
        nodes.read_until(lambda: "path" in nodes.values)
        yield nodes


def test_what_can_be_driven_is_known():
    assert velocity_topic(graph_of("quadrotor")) == "/cmd_vel"
    assert velocity_topic(Graph(None, ())) is None


def test_it_drives_while_a_button_is_held(client, husky):
    truth = husky.subscribe("/ground_truth/odom")

    def now():
        return truth.take(10)

    hold = Hold(client, "forward", speed=0.5)
    client.read_until(lambda: hold() and len(husky.velocities) > 3)
    assert set(husky.velocities) == {(0.5, 0.0, 0.0)}
    client.read_until(lambda: hold() and now().position_xyz[0] > 0.3)
    hold.release()
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0))
    client.read_until(lambda: np.abs(now().linear_xyz).max() < 0.01)


def test_a_browser_that_leaves_lets_go_at_once(client, husky, port, monkeypatch):
    monkeypatch.setattr(live_robot, "_LAPSE_S", 3600)
    with Live(port, ROBOT) as other:
        hold = Hold(other, "forward")
        client.read_until(lambda: hold() and (0.8, 0.0, 0.0) in husky.velocities)
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0))
    for _ in range(3):  # the same press by another connection
        Hold.presses -= 1
        Hold(client, "forward")()
    again = Hold(client, "back")
    client.read_until(lambda: again() and (-0.8, 0.0, 0.0) in husky.velocities)
    assert husky.velocities.count((0.0, 0.0, 0.0)) == 1
    again.release()


def test_a_browser_that_falls_silent_lets_go(client, husky):
    hold = Hold(client, "forward left")
    client.read_until(lambda: hold() and (0.8, 0.0, 0.6) in husky.velocities)
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0))
    stopped = len(husky.velocities)
    for _ in range(3):  # what was under way when the connection was lost
        hold()
    again = Hold(client, "back")
    client.read_until(lambda: again() and len(husky.velocities) > stopped)
    assert set(husky.velocities[stopped:]) == {(-0.8, 0.0, 0.0)}, "it takes another press"


HOSTILE = [
    "",
    "1",
    '{"do": "hold"}',
    '{"do": "hold", "press": 3, "names": ["forward"]}',
    '{"do": "hold", "press": "x", "names": "forward"}',
    '{"do": "hold", "press": "x", "names": ["sideways"]}',
    '{"do": "hold", "press": "x", "names": ["forward"], "speed": 3.1}',
    '{"do": "hold", "press": "x", "names": ["forward"], "speed": -1}',
    '{"do": "hold", "press": "x", "names": ["forward"], "speed": 1e999}',
    '{"do": "hold", "press": "x", "names": ["forward"], "turn": NaN}',
    '{"do": "hold", "press": "' + "x" * 4000 + '", "names": ["forward"]}',
    '{"do": "act", "action": "no such"}',
    '{"do": "act", "action": "__class__"}',
]


def test_what_is_no_button_moves_nothing(client, husky, caplog):
    for text in HOSTILE:
        client.socket.send(text)
    hold = Hold(client, "right")
    client.read_until(lambda: hold() and husky.velocities)
    assert set(husky.velocities) == {(0.0, 0.0, -0.6)}
    assert not husky.actions
    assert not [record for record in caplog.records if record.exc_info]


def test_a_viewer_drives_nothing_and_stops_nothing(client, husky, port):
    with Live(port, ROBOT, VIEW_TOKEN) as viewer:
        viewer.read_until(lambda: viewer.state.get("moves"))
        Hold(viewer, "back")()
        hold = Hold(client, "forward")
        client.read_until(lambda: hold() and len(husky.velocities) > 3)
        viewer.send("stop")
        viewer.send("act", action="reset")
        sent = len(husky.velocities)
        client.read_until(lambda: hold() and len(husky.velocities) > sent + 3)
    assert set(husky.velocities) == {(0.8, 0.0, 0.0)}
    assert not husky.actions
    hold.release()


def test_many_presses_hold_no_stop_up(client, husky):
    hold = Hold(client, "forward")
    client.read_until(lambda: hold() and husky.velocities)
    for number in range(2000):
        client.send("hold", press=f"other {number}", names=["back"])
    client.send("stop")
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0) or not hold())
    assert (-0.8, 0.0, 0.0) not in husky.velocities[: husky.velocities.index((0.0, 0.0, 0.0))]


def test_whatever_else_is_being_done_a_stop_is_at_once(client, husky, nodes):
    free, told = threading.Event(), []

    def act(node, action):
        told.append(action)
        assert free.wait(60)

    def set_slowly(values):
        told.append("slow")
        assert free.wait(60)

    husky.act = act
    husky.parameters["path"].update = set_slowly
    hold = Hold(client, "forward")
    client.read_until(lambda: hold() and len(husky.velocities) > 3)
    nodes.send("act", node="path", action="clear")
    nodes.send("set", values={"path": {"max_poses": 5000}})
    client.read_until(lambda: hold() and set(told) == {"clear", "slow"})
    client.send("stop")  # from whichever browser
    hold()
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0), timeout_s=10)
    free.set()


@source(
    "blimp",
    params=NoParams,
    inputs={"cmd_vel": Twist},
    outputs={"odom": Odometry},
    velocity_axes=("linear.z",),
)
class Blimp:
    """It goes up and down, and needs no take-off."""

    def __init__(self, _, playback):
        self._playback = playback

    def messages(self):
        while not self._playback.closed:
            time.sleep(0.01)
            yield "odom", Odometry(np.zeros(3), np.array([0.0, 0, 0, 1]))

    def close(self):
        pass


def test_a_robot_is_driven_along_the_axes_that_it_declares(port):
    declared = Blimp.declared
    blimp = SourceNode("blimp", declared, NoParams(), {"cmd_vel": "/cmd_vel"}, {"odom": "/odom"})
    running = LocalRuntime(Graph(blimp, ()), Playback(hold=True))
    told, page = Told(running), Page(ViewOptions(port=port))
    page.open(told)
    running.start()
    client = Live(port, ROBOT)
    try:
        client.read_until(lambda: client.state.get("moves"))
        hold = Hold(client, "forward up")
        client.read_until(lambda: hold() and len(told.velocities) > 3)
        assert set(told.velocities) == {(0.0, 0.8, 0.0)}
    finally:
        client.__exit__()
        page.close()
        running.stop()


def test_a_rover_goes_neither_up_nor_down(client, husky):
    hold = Hold(client, "up left")
    client.read_until(lambda: hold() and len(husky.velocities) > 3)
    assert {up for _, up, _ in husky.velocities} == {0.0}


def test_an_action_is_done_by_its_node(nodes, husky):
    nodes.send("act", node="path", action="clear")
    nodes.read_until(lambda: husky.actions)
    assert husky.actions == [("path", "clear")]
