"""Vehicles beside a source: their topics, what they are sent, and the end of a run."""

import math

import pytest
from links_ends import PX4, FakeVehicle, Station, free_port

from ros_visualise.core.errors import UsageError
from ros_visualise.graph import place
from ros_visualise.graph.landmarks import with_landmarks
from ros_visualise.graph.pipelines import image_pipeline, simulation_pipeline
from ros_visualise.graph.vehicles import as_vehicle, guiding_vehicles, with_vehicles
from ros_visualise.nodes import find_node
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sources.playback import Playback


def test_a_run_ends_with_its_source_and_holds_the_telemetry():
    port = free_port()
    graph = with_vehicles(image_pipeline("landscape", size="64x48"), [f"udp://:{port}"])
    graph = with_landmarks(graph, ["/image_raw"], ["tag_detector"])
    landing = {"detections": "/detections", "odom": "/autopilot/odom"}
    graph = guiding_vehicles(graph.joined(place(find_node("landing_target"), landing)))
    playback = Playback(duration_s=1.5)
    runtime = LocalRuntime(graph, playback)
    vehicle = FakeVehicle(port, PX4)
    try:
        runtime.start()
        assert runtime.wait(60)
        report = runtime.report()
    finally:
        vehicle.close()
        runtime.stop()
    assert report.topics["/autopilot/odom"].messages > 10
    assert report.topics["/tf"].messages == report.topics["/autopilot/odom"].messages
    assert report.nodes["autopilot"].own["messages"] > 20


def test_they_get_what_nodes_make_and_nothing_else():
    graph = simulation_pipeline("quadrotor")
    graph = with_vehicles(graph, ["udp://:14540", "udp://:14541"])
    whole = guiding_vehicles(with_landmarks(graph, ["/image_raw"], ["tag_detector"]))
    for name in ("autopilot", "autopilot_2"):
        assert whole.node(name).inputs == {"landing_target": "/landing_target"}
        assert whole.node(name).params.simulated
    assert whole.node("autopilot").outputs["tf"] == "/autopilot/tf"  # the robot has its own
    assert whole.node("autopilot_2").outputs["odom"] == "/autopilot_2/odom"
    with pytest.raises(UsageError, match="given twice"):
        with_vehicles(graph, ["udp://:14540", "udp://:14540"])


def test_a_pose_from_its_own_odometry_is_not_sent_back():
    graph = with_vehicles(image_pipeline("camera"), ["udp://:14540"])
    own = guiding_vehicles(with_landmarks(graph, ["/image_raw"], ["tag_detector"], navigate=True))
    assert own.node("landmark_navigator").inputs["odometry"] == "/autopilot/odom"
    assert not own.node("autopilot").inputs
    graph = with_vehicles(simulation_pipeline("quadrotor"), ["udp://:14540"])
    other = guiding_vehicles(with_landmarks(graph, ["/image_raw"], ["tag_detector"], navigate=True))
    assert other.node("autopilot").inputs["pose"] == "/navigation/pose"


def test_a_simulated_quadrotor_is_a_vehicle_that_flies():
    station = Station()
    graph = as_vehicle(simulation_pipeline("quadrotor"), [f"udpout://127.0.0.1:{station.port}"])
    unused = {"camera": False, "lidar": False, "imu_rate": 1.0}
    runtime = LocalRuntime(graph.configured({"quadrotor": unused}), Playback())
    try:
        runtime.start()
        start = station.wait("LOCAL_POSITION_NED")
        assert station.command(400, 1) == 0
        assert station.command(22, 0, 0, 0, *[math.nan] * 4) == 0
        risen = station.wait("LOCAL_POSITION_NED", lambda m: m.z < -1)
    finally:
        runtime.stop()
        station.close()
    assert math.dist((risen.x, risen.y), (start.x, start.y)) < 0.3


def test_a_rover_is_no_vehicle():
    with pytest.raises(UsageError, match="needs a flying robot"):
        as_vehicle(simulation_pipeline("husky"), ["udp://:14550"])


def test_one_end_of_a_line_is_no_other_one():
    robot = simulation_pipeline("quadrotor")
    with pytest.raises(UsageError, match="given twice"):
        as_vehicle(robot, ["udp://:14550", "udp://:14550"])
    with pytest.raises(
        UsageError, match="--mavlink-vehicle uses the same address; give --mavlink-vehicle udpout"
    ):
        with_vehicles(as_vehicle(robot, ["udp://:14550"]), ["udp://:14550"])
