"""Driving a robot from the page, and asking nodes to do something."""

import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from page_client import Client

from ros_visualise.data import Odometry, Twist
from ros_visualise.graph import Graph, SourceNode
from ros_visualise.graph.pipelines import simulation_pipeline
from ros_visualise.nodes import NoParams, source
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback
from ros_visualise.ui import ViewOptions
from ros_visualise.ui.page import Page
from ros_visualise.ui.page.robot import velocity_topic


def graph_of(robot: str) -> Graph:
    whole = simulation_pipeline(robot, camera=False, lidar=False, world="plane")
    return Graph(whole.source, tuple(node for node in whole.nodes if node.name == "path"))


class Hold:
    """A press of buttons that is told again with each call, as a browser does."""

    presses = 0

    def __init__(self, client: Client, names: str) -> None:
        Hold.presses += 1
        self._client, self._press, self._names, self._number = client, Hold.presses, names, 0

    def __call__(self) -> bool:
        self._number += 1
        self._client.set("hold", f"{self._press} {self._number} {self._names}")
        return True

    def release(self) -> None:
        self._names = ""
        self()


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
    client = Client(port)
    try:
        client.read_until(lambda: "hold" in client.values)
        truth = told.subscribe("/ground_truth/odom")
        hold = Hold(client, "down")
        client.read_until(lambda: hold() and len(told.velocities) > 2)
        client.set("Clear", True)
        client.read_until(lambda: hold() and told.actions == [("path", "clear")])
        before = len(told.velocities)
        client.read_until(lambda: hold() and len(told.velocities) > before + 1)
        client.set("Commands", "Take off")
        client.read_until(lambda: truth.take(10).position_xyz[2] > 1.0)
        after = told.velocities[told.velocities.index((0.0, 0.0, 0.0)) :]
        assert after == [(0.0, 0.0, 0.0)], "one that stops it, then none any more"
    finally:
        client.close()
        page.close()
        running.stop()


@pytest.fixture
def client(husky, port) -> Iterator[Client]:
    client = Client(port)
    client.read_until(lambda: "hold" in client.values)
    yield client
    client.close()


def test_what_can_be_driven_is_known():
    assert velocity_topic(graph_of("quadrotor")) == "/cmd_vel"
    assert velocity_topic(Graph(None, ())) is None


def test_it_drives_while_a_button_is_held(client, husky):
    truth = husky.subscribe("/ground_truth/odom")

    def now():
        return truth.take(10)

    client.set("Speed", 0.5)
    hold = Hold(client, "forward")
    client.read_until(lambda: hold() and len(husky.velocities) > 3)
    assert set(husky.velocities) == {(0.5, 0.0, 0.0)}
    client.read_until(lambda: hold() and now().position_xyz[0] > 0.3)
    hold.release()
    client.read_until(lambda: husky.velocities[-1] == (0.0, 0.0, 0.0))
    client.read_until(lambda: np.abs(now().linear_xyz).max() < 0.01)
    sent = len(husky.velocities)
    client.set("Speed", 2.0)
    client.set("Turn speed", 1.5)
    client.read_until(lambda: client.values["Turn speed"] == 1.5 and now() is not None)
    assert len(husky.velocities) == sent, "sliders do not move a robot"


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


def test_what_is_no_button_moves_nothing(client, husky):
    for told in ("", "1", "1 2 sideways", "x" * 4000, "forward"):
        client.set("hold", told)
    hold = Hold(client, "right")
    client.read_until(lambda: hold() and husky.velocities)
    assert set(husky.velocities) == {(0.0, 0.0, -0.6)}


def test_whatever_else_is_being_done_a_stop_is_at_once(client, husky):
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
    client.set("Clear", True)
    client.set("Max poses", 5000)
    client.read_until(lambda: hold() and set(told) == {"clear", "slow"})
    Hold(client, "stop")()  # from whichever browser
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
    client = Client(port)
    try:
        client.read_until(lambda: "hold" in client.values)
        hold = Hold(client, "forward up")
        client.read_until(lambda: hold() and len(told.velocities) > 3)
        assert set(told.velocities) == {(0.0, 0.8, 0.0)}
    finally:
        client.close()
        page.close()
        running.stop()


def test_a_rover_goes_neither_up_nor_down(client, husky):
    hold = Hold(client, "up left")
    client.read_until(lambda: hold() and len(husky.velocities) > 3)
    assert {up for _, up, _ in husky.velocities} == {0.0}


def test_an_action_is_a_button(client, husky):
    client.set("Clear", True)
    client.read_until(lambda: husky.actions)
    assert husky.actions == [("path", "clear")]
