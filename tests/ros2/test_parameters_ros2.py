"""Our nodes' parameters as stock rclpy sees and sets them, and theirs as we do."""

from __future__ import annotations

import gc
import signal
import subprocess
from collections.abc import Callable
from typing import Any

import pytest
import rclpy
from rcl_interfaces.msg import ParameterEvent, ParameterType
from rcl_interfaces.srv import DescribeParameters
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.task import Future
from waiting import wait_for

from ros_visualise.core.errors import ParameterError
from ros_visualise.runtime.remote.parameters import RemoteParameters
from ros_visualise.runtime.ros2 import parameters_client
from ros_visualise.runtime.ros2.parameters_client import ParameterServices
from ros_visualise.runtime.ros2.services import result_of
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.transport import Ros2Transport

PATIENCE_S = 60.0


class Asked:
    """The parameter services of a node, as any other node calls them."""

    def __init__(self, ros2: Ros2Transport, node: str) -> None:
        self._services = ParameterServices(ros2.session.node, node)
        wait_for(lambda: self._services.are_ready, node)

    def names(self) -> list[str]:
        return list(result_of(self._services.list(), PATIENCE_S).result.names)

    def describe(self, *names: str) -> Any:
        return result_of(self._services.describe(names), PATIENCE_S).descriptors

    def get(self, *names: str) -> Any:
        return result_of(self._services.get(names), PATIENCE_S).values

    def set(self, **values: Any) -> Any:
        asked = [Parameter(name.replace("__", "."), value=v) for name, v in values.items()]
        return result_of(self._services.set(asked), PATIENCE_S).result


@pytest.fixture
def pipeline(start: Callable[..., Any], ros2: Ros2Transport) -> Asked:
    start("pipeline", edge_detector__low=30, filters__blur="off", view="none")
    asked = Asked(ros2, "/pipeline")
    needed = {"edge_detector.low", "filters.gray"}
    wait_for(lambda: needed <= set(asked.names()), "its parameters")
    return asked


def test_they_are_described_and_set_as_one_whole_or_refused_with_a_reason(pipeline: Asked):
    low, aperture, blur, members, scale = pipeline.describe(
        "edge_detector.low", "edge_detector.aperture", "filters.blur", "members", "filters.scale"
    )
    assert low.type == ParameterType.PARAMETER_INTEGER
    assert low.description
    assert (low.integer_range[0].from_value, low.integer_range[0].to_value) == (0, 800)
    assert aperture.type == ParameterType.PARAMETER_INTEGER
    assert "gaussian" in blur.additional_constraints
    assert members.read_only
    assert 0 < scale.floating_point_range[0].from_value < scale.floating_point_range[0].to_value
    assert [one.integer_value for one in pipeline.get("edge_detector.low")] == [30]

    assert pipeline.set(edge_detector__low=40, filters__gray=False).successful
    refused = pipeline.set(edge_detector__low=41, filters__blur="magic")
    assert not refused.successful
    assert "magic" in refused.reason
    assert "gaussian" in refused.reason
    assert not pipeline.set(edge_detector__low=801).successful
    assert pipeline.set(edge_detector__aperture=5).successful
    assert "one of 3, 5, 7" in pipeline.set(edge_detector__aperture=4).reason
    assert not pipeline.set(members=["a"]).successful
    low_now, gray = pipeline.get("edge_detector.low", "filters.gray")
    assert (low_now.integer_value, gray.bool_value) == (40, False)


def test_values_are_taken_as_yaml_reads_them_and_the_time_stays(pipeline: Asked):
    for off in (False, "off"):
        assert pipeline.set(filters__blur="gaussian").successful
        assert pipeline.set(filters__blur=off).successful
        assert pipeline.get("filters.blur")[0].string_value == "off"
    assert pipeline.set(filters__scale=1, edge_detector__low=33.0).successful
    scale, low = pipeline.get("filters.scale", "edge_detector.low")
    assert (scale.double_value, low.integer_value) == (1.0, 33)
    assert "choose one of off" in pipeline.set(filters__blur=3).reason
    assert "out of range" in pipeline.set(filters__scale=99).reason
    assert pipeline.set(use_sim_time=False).successful
    refused = pipeline.set(use_sim_time=True)
    assert "start it again with -p use_sim_time:=true" in refused.reason
    assert not pipeline.get("use_sim_time")[0].bool_value


def test_options_that_a_node_has_no_use_for_are_no_parameters(
    start: Callable[..., Any], ros2: Ros2Transport
):
    start("filters")
    asked = Asked(ros2, "/filters")
    wait_for(lambda: "gray" in asked.names(), "its parameters")
    unused = {"host", "port", "window", "allow_origin", "start", "duration", "clock"}
    assert not unused & set(asked.names())
    assert {"view", "image_transport", "record_dir"} <= set(asked.names())


def test_a_change_is_told_of_once_and_options_are_among_them(pipeline: Asked, ros2: Ros2Transport):
    [source, nodes] = pipeline.describe("source", "nodes")
    assert source.read_only
    assert nodes.read_only
    assert pipeline.get("nodes")[0].string_value == "fps_control filters edge_detector"
    told: list[str] = []

    def hear(event: ParameterEvent) -> None:
        told.extend(one.name for one in event.changed_parameters if event.node == "/pipeline")

    heard = ros2.session.node.create_subscription(ParameterEvent, "/parameter_events", hear, 100)
    wait_for(lambda: heard.get_publisher_count() > 1, "its events")
    for low in range(50, 55):
        assert pipeline.set(edge_detector__low=low).successful
    wait_for(lambda: told.count("edge_detector.low") == 5, "the changes")
    assert pipeline.set(filters__gray=False).successful
    wait_for(lambda: "filters.gray" in told, "the last change")
    assert told.count("edge_detector.low") == 5
    ros2.session.node.destroy_subscription(heard)


def test_a_change_by_others_is_followed_and_a_refusal_names_its_reason(
    pipeline: Asked, ros2: Ros2Transport
):

    def is_seen() -> bool:
        return "/pipeline/edge_detector" in ros2.listing().parameters.get("/pipeline", ())

    wait_for(is_seen, "its nodes")
    edges = RemoteParameters(ros2, "/pipeline/edge_detector")
    assert edges.wait(PATIENCE_S)
    assert edges.node is not None
    assert edges.node.name == "edge_detector"
    assert edges.current.low == 30
    pipeline.set(edge_detector__low=77)
    wait_for(lambda: edges.current.low == 77, "the change")
    edges.update({"low": 5, "high": 6})
    values = pipeline.get("edge_detector.low", "edge_detector.high")
    assert [one.integer_value for one in values] == [5, 6]
    edges.close()


def test_parameters_of_any_node_are_followed_and_set(ros2: Ros2Transport):
    other = Ros2Transport(Ros2Session("other", []))
    node = other.session.node
    node.declare_parameter("camera.gain", 1.5)
    node.declare_parameter("names", ["a", "b"])
    seen = RemoteParameters(ros2, "/other")
    assert seen.wait(PATIENCE_S)
    assert vars(seen.current) == {"camera_gain": 1.5, "names": "['a', 'b']"}
    seen.update({"camera_gain": 2.5})
    assert node.get_parameter("camera.gain").value == 2.5
    node.add_on_set_parameters_callback(lambda _: _refusal())
    with pytest.raises(ParameterError, match="too warm"):
        seen.update({"camera_gain": 3.5})
    seen.close()
    other.close()


def test_a_node_that_answers_nobody_costs_one_client_until_it_is_gone(
    ros2: Ros2Transport, monkeypatch: pytest.MonkeyPatch
):
    """One of the parameter services is there, and nobody answers."""
    context = Context()
    rclpy.init(args=[], context=context)
    mute = rclpy.create_node("mute", context=context, start_parameter_services=False)
    mute.create_service(DescribeParameters, "~/describe_parameters", lambda _, answer: answer)
    node = ros2.session.node

    def clients() -> list[str]:
        return [one.srv_name for one in node.clients if "mute" in one.srv_name]

    wait_for(lambda: ros2.listing() and clients(), "the node to be asked")
    monkeypatch.setattr(parameters_client, "_ANSWER_S", 0.0)
    for _ in range(20):
        ros2.listing()
    assert len(clients()) == 1
    gc.collect()
    waiting = [one for one in gc.get_objects() if isinstance(one, Future) and not one.done()]
    assert len(waiting) < 20
    mute.destroy_node()
    context.shutdown()
    wait_for(lambda: ros2.listing() and not clients(), "nobody to be asked")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_and_takes_it_off_the_graph(
    number: signal.Signals, start: Callable[..., subprocess.Popen[str]], ros2: Ros2Transport
):
    process = start("filters")
    wait_for(lambda: "/filters" in ros2.listing().parameters, "the node")
    process.send_signal(number)
    assert process.wait(timeout=PATIENCE_S) == 0
    wait_for(lambda: "/filters" not in ros2.listing().parameters, "it to be gone", 5)


def _refusal() -> Any:
    from rcl_interfaces.msg import SetParametersResult

    return SetParametersResult(successful=False, reason="too warm")
