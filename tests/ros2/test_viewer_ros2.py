"""The viewer on a graph of somebody else's nodes: their topics, and their parameters."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rcl_interfaces.msg import IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Image, LaserScan, PointCloud2, PointField
from tf2_msgs.msg import TFMessage
from waiting import wait_for

from ros_visualise.core.errors import ParameterError
from ros_visualise.core.params import specs
from ros_visualise.runtime.remote.runtime import RemoteRuntime
from ros_visualise.runtime.ros2.transport import Ros2Transport

NAME = "somebody"


class Somebody:
    """A node that is rclpy's alone, with a camera, a lidar, a map, frames and parameters."""

    def __init__(self) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node(NAME, context=self._context)
        turns = ParameterDescriptor(
            description="turns a minute",
            integer_range=[IntegerRange(from_value=1, to_value=9, step=1)],
        )
        self._node.declare_parameter("turns", 3, turns)
        self._node.declare_parameter("label", "a")
        self._node.declare_parameter("min-x", 0.5)
        self._node.declare_parameter("gains", [1.0, 2.5])
        self._node.declare_parameter("frame", "odom", ParameterDescriptor(read_only=True))
        self._node.add_on_set_parameters_callback(_judge)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_publisher(OccupancyGrid, "map", kept).publish(_map())
        self._published = [
            (self._node.create_publisher(type(one), topic, qos), one)
            for topic, one, qos in (
                ("cam/image", _image(), qos_profile_sensor_data),
                ("scan", _scan(), qos_profile_sensor_data),
                ("cloud", _cloud(), qos_profile_sensor_data),
                ("wheels", _odometry(), 10),
                ("/tf", _frames(), 100),
            )
        ]
        self._node.create_timer(0.1, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()
        self._node.destroy_node()
        self._context.shutdown()

    def _spin(self) -> None:
        while not self._closed.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def _publish(self) -> None:
        for publisher, message in self._published:
            publisher.publish(message)


def _judge(asked: list[Any]) -> SetParametersResult:
    is_bad = any(one.value == "bad" for one in asked)
    return SetParametersResult(successful=not is_bad, reason="I do not like it" if is_bad else "")


def _image() -> Image:
    image = Image(height=2, width=3, encoding="mono8", step=3, data=[1, 2, 3, 4, 5, 6])
    image.header.frame_id = "eye"
    image.header.stamp.sec = 7
    return image


def _scan() -> LaserScan:
    scan = LaserScan(angle_min=-1.0, angle_max=1.0, angle_increment=1.0, range_max=9.0)
    scan.header.frame_id = "base"
    scan.ranges = [1.0, 2.0, 3.0]
    return scan


def _cloud() -> PointCloud2:
    fields = [PointField(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")]
    data = np.arange(6, dtype=np.float32).tobytes()
    cloud = PointCloud2(height=1, width=2, point_step=12, row_step=24, fields=fields, data=data)
    cloud.header.frame_id = "base"
    return cloud


def _odometry() -> Odometry:
    odometry = Odometry(child_frame_id="base")
    odometry.header.frame_id = "odom"
    odometry.pose.pose.position.x = 4.0
    odometry.pose.pose.orientation.w = 1.0
    return odometry


def _frames() -> TFMessage:
    frame = TransformStamped(child_frame_id="base")
    frame.header.frame_id = "odom"
    frame.transform.rotation.z = frame.transform.rotation.w = math.sqrt(0.5)
    return TFMessage(transforms=[frame])


def _map() -> OccupancyGrid:
    grid = OccupancyGrid(data=[0, 100])
    grid.header.frame_id = "map"
    grid.info.width, grid.info.height, grid.info.resolution = 2, 1, 0.5
    grid.info.origin.orientation.w = 1.0
    return grid


@pytest.fixture
def viewer(graph: dict[str, str], ros2: Ros2Transport) -> Iterator[RemoteRuntime]:
    with closing(Somebody()), closing(RemoteRuntime(ros2)) as remote:
        yield remote


def first(viewer: RemoteRuntime, topic: str) -> Any:
    """A message of the topic, as soon as there is one."""
    wait_for(lambda: topic in viewer.graph.topics, topic)
    subscription = viewer.subscribe(topic)
    try:
        return wait_for(lambda: subscription.take(0.1), f"a message on {topic}")
    finally:
        subscription.close()


def test_all_topics_that_can_be_drawn_are_there_with_what_is_on_them(viewer: RemoteRuntime):
    image = first(viewer, "/cam/image")
    assert image.pixels.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert (image.header.stamp_ns, image.header.frame_id) == (7_000_000_000, "eye")
    assert first(viewer, "/scan").ranges.tolist() == [1, 2, 3]
    assert len(first(viewer, "/cloud").xyz) == 2
    assert first(viewer, "/wheels").position_xyz.tolist() == [4, 0, 0]
    assert first(viewer, "/tf").transforms[0].child_frame_id == "base"
    assert first(viewer, "/map").cells.ravel().tolist() == [0, 100]  # came before us


def test_its_parameters_have_ranges_and_are_set(viewer: RemoteRuntime):
    def is_told() -> bool:
        return NAME in viewer.parameters and hasattr(viewer.parameters[NAME].current, "turns")

    wait_for(is_told, "its parameters")
    seen = viewer.parameters[NAME]
    wait_for(lambda: seen.current.turns == 3, "its values")
    turns = next(spec for spec in specs(seen.current) if spec.name == "turns")
    assert (turns.min, turns.max, turns.help) == (1, 9, "turns a minute")
    assert (turns.step, seen.current.gains, seen.current.frame) == (1, "[1.0, 2.5]", "odom")
    fixed = {spec.name for spec in specs(seen.current) if not spec.used(seen.current)}
    assert {"gains", "frame"} <= fixed
    assert "min-x" in {spec.label for spec in specs(seen.current)}
    seen.update({"turns": 5, "min_x": 0.25})
    assert (seen.current.turns, seen.current.min_x) == (5, 0.25)
    with pytest.raises(ParameterError, match="I do not like it"):
        seen.update({"label": "bad"})
    assert seen.current.label == "a"
