"""A managed pipeline as managers of ROS 2 drive it, such as Nav2's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from sensor_msgs.msg import Image
from waiting import wait_for

from ros_visualise.runtime.ros2.services import result_of
from ros_visualise.runtime.ros2.transport import Ros2Transport

PATIENCE_S = 60.0


class Manager:
    """Drives a node as `nav2_lifecycle_manager` does, by its services."""

    def __init__(self, ros2: Ros2Transport, name: str) -> None:
        self._node = ros2.session.node
        self._name = name
        self.labels: list[str] = []
        self._events = self._node.create_subscription(
            TransitionEvent, f"{name}/transition_event", self._hear, 10
        )

    def _hear(self, event: TransitionEvent) -> None:
        self.labels.append(event.goal_state.label)

    def ask(self, kind: Any, service: str, **request: Any) -> Any:
        client = self._node.create_client(kind, f"{self._name}/{service}")
        try:
            wait_for(client.service_is_ready, service)
            return result_of(client.call_async(kind.Request(**request)), PATIENCE_S)
        finally:
            self._node.destroy_client(client)

    @property
    def state(self) -> str:
        return str(self.ask(GetState, "get_state").current_state.label)

    def change(self, number: int = 0, label: str = "") -> bool:
        transition = Transition(id=number, label=label)
        return bool(self.ask(ChangeState, "change_state", transition=transition).success)

    def close(self) -> None:
        self._node.destroy_subscription(self._events)


@pytest.fixture
def manager(ros2: Ros2Transport) -> Any:
    made = Manager(ros2, "/pipeline")
    yield made
    made.close()


def test_a_pipeline_goes_through_its_states(
    start: Callable[..., Any], ros2: Ros2Transport, manager: Manager
):
    start("pipeline", nodes="edge_detector", managed=True)
    node = ros2.session.node
    images = node.create_publisher(Image, "/image_raw", 10)
    heard: list[Image] = []
    listening = node.create_subscription(Image, "/edges", heard.append, 10)
    image = Image(height=4, width=6, encoding="mono8", step=6, data=[0] * 24)

    assert manager.state == "unconfigured"
    assert not manager.change(Transition.TRANSITION_ACTIVATE)  # not from here
    assert manager.change(Transition.TRANSITION_CONFIGURE)
    assert manager.state == "inactive"
    assert not images.get_subscription_count()
    for _ in range(2):
        assert manager.change(Transition.TRANSITION_ACTIVATE)
        assert manager.state == "active"
        wait_for(lambda: images.publish(image) or heard, "edges")
        assert manager.change(Transition.TRANSITION_DEACTIVATE)
        wait_for(lambda: not images.get_subscription_count(), "it to listen no more")
        heard.clear()
    assert manager.change(Transition.TRANSITION_CLEANUP)
    wait_for(lambda: not listening.get_publisher_count(), "it to leave its topics")
    assert manager.change(label="configure")
    wait_for(lambda: listening.get_publisher_count(), "its topics again")
    assert manager.change(Transition.TRANSITION_INACTIVE_SHUTDOWN)
    assert manager.state == "finalized"
    wait_for(lambda: "finalized" in manager.labels, "the event")
    assert [label for label in manager.labels if not label.endswith("ing")][:4] == [
        *("inactive", "active", "inactive", "active")
    ]
    node.destroy_subscription(listening)
    node.destroy_publisher(images)


def test_what_cannot_be_configured_stays_unconfigured(start: Callable[..., Any], manager: Manager):
    process = start("pipeline", source="streamer", streamer__path="/no/film.mp4", managed=True)
    for _ in range(2):
        assert not manager.change(Transition.TRANSITION_CONFIGURE)
        assert manager.state == "unconfigured"
    process.terminate()
    said, _ = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert said.count("cannot configure: /no/film.mp4: no such file") == 2


def test_states_and_transitions_are_listed(start: Callable[..., Any], manager: Manager):
    start("pipeline", managed=True)
    states = manager.ask(GetAvailableStates, "get_available_states").available_states
    assert {"unconfigured", "inactive", "active", "finalized"} <= {one.label for one in states}
    here = manager.ask(GetAvailableTransitions, "get_available_transitions").available_transitions
    assert {one.transition.label for one in here} == {"configure", "shutdown"}
    graph = manager.ask(GetAvailableTransitions, "get_transition_graph").available_transitions
    assert {"activate", "deactivate", "cleanup"} <= {one.transition.label for one in graph}
