"""Our executables on a real graph, as stock rclpy sees them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from made_videos import numbered, write_video
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image
from test_topics_ros2 import Stock, stock
from waiting import wait_for

__all__ = ["stock"]
FRAMES = 12
ALL = QoSProfile(depth=100)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def film(folder: Path) -> Path:
    return write_video(folder / "v.mkv", numbered(FRAMES, 160, 120))


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def test_a_film_played_as_fast_as_possible_comes_whole_and_its_node_ends(
    start: Callable[..., Any], stock: Stock, tmp_path: Path
):
    images = stock.hear(Image, "/image_raw", ALL)
    infos = stock.hear(CameraInfo, "/camera_info", ALL)
    streamer = start("streamer", path=str(film(tmp_path)), rate=0.0)
    wait_for(lambda: stock.spin() and len(images) == len(infos) == FRAMES, "the film")
    assert streamer.wait(60) == 0
    for message, pixels in zip(images, numbered(FRAMES, 160, 120), strict=True):
        assert (message.encoding, message.step) == ("bgr8", 480)
        assert message.header.frame_id == "camera_optical"
        assert bytes(message.data) == pixels.tobytes()
    assert (np.diff([stamp_ns(image) for image in images]) > 0).all()
    assert [stamp_ns(info) for info in infos] == [stamp_ns(image) for image in images]


def test_a_node_reports_to_diagnostics(start: Callable[..., Any], stock: Stock, tmp_path: Path):
    heard: list[DiagnosticArray] = stock.hear(DiagnosticArray, "/diagnostics", ALL)
    start("streamer", path=str(film(tmp_path)), loop=True)
    start("fps_control", fps=5)

    def reported() -> dict[str, str]:
        stock.spin()
        for status in (status for array in heard for status in array.status):
            values = {one.key: one.value for one in status.values}
            if status.name == "/fps_control" and "dropped/rate" in values:
                return values
        return {}

    values = wait_for(reported, "figures of fps_control")
    assert values["requested_hz"] == "5"
    assert int(values["received"]) >= int(values["processed"]) > 0


def test_a_path_is_there_for_latecomers(start: Callable[..., Any], stock: Stock):
    start("path")
    poses = stock.node.create_publisher(Odometry, "/odom", 10)
    wait_for(poses.get_subscription_count, "the node")
    early = stock.hear(PathMessage, "/path", LATCHED)
    message = Odometry(child_frame_id="base_link")
    message.header.frame_id, message.pose.pose.orientation.w = "odom", 1.0

    def drive() -> bool:
        message.header.stamp.sec += 1
        message.pose.pose.position.x += 1.0
        poses.publish(message)
        return stock.spin() and bool(early) and len(early[-1].poses) > 2

    wait_for(drive, "a path")
    late = stock.hear(PathMessage, "/path", LATCHED)
    wait_for(lambda: stock.spin() and late, "the path of those who were there")
    assert len(late[0].poses) > 2
    assert late[0].header.frame_id == "odom"


def test_simulated_time_paces_and_stamps(start: Callable[..., Any], stock: Stock, tmp_path: Path):
    images = stock.hear(Image, "/image_raw", ALL)
    start("streamer", path=str(film(tmp_path)), use_sim_time=True)
    clock = stock.node.create_publisher(Clock, "/clock", 10)
    now = Clock()
    now.clock.sec = 100

    def passes() -> bool:
        now.clock.nanosec += 10_000_000
        clock.publish(now)
        return stock.spin() and len(images) >= 5

    wait_for(passes, "five images")
    stamps_ns = [stamp_ns(image) for image in images[:5]]
    assert 100 * 10**9 <= stamps_ns[0] < stamps_ns[-1] <= stamp_of(now)
    np.testing.assert_allclose(np.diff(stamps_ns), 40e6, atol=11e6)


def stamp_of(clock: Clock) -> int:
    return int(clock.clock.sec * 10**9 + clock.clock.nanosec)
