"""Topics beside stock rclpy: images as they were, whatever is offered, and no silence unsaid."""

from __future__ import annotations

import logging
import threading
from array import array
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.waitable import NumberOfEntities, Waitable
from sensor_msgs.msg import Image as ImageMessage
from std_msgs.msg import String
from waiting import wait_for

from ros_visualise.core import supervision
from ros_visualise.core.errors import UsageError
from ros_visualise.data import Header, Image, Text
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.qos import LATCHED, QoS
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.transport import Ros2Transport

IMAGE = TopicType("sensor_msgs/msg/Image")
TEXT = "std_msgs/msg/String"
NS = 1_000_000_000


class Stock:
    """A node that is rclpy's alone."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        self.node: Node = rclpy.create_node("stock", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def hear(self, kind: Any, topic: str, qos: Any) -> list[Any]:
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, qos)
        return heard

    def spin(self) -> bool:
        self._executor.spin_once(timeout_sec=0.02)
        return True

    def close(self) -> None:
        self.node.destroy_node()
        self.context.shutdown()


@pytest.fixture
def stock(graph: dict[str, str]) -> Iterator[Stock]:
    made = Stock()
    yield made
    made.close()


def picture(number: int, size: int = 6) -> Image:
    pixels = np.arange(size * 4 * 3, dtype=np.uint32).astype(np.uint8) + np.uint8(number)
    return Image(pixels.reshape(4, size, 3), "bgr8", Header(number * NS + 7, "camera"))


@pytest.mark.parametrize("reliability", ["RELIABLE", "BEST_EFFORT"])
def test_a_stock_subscriber_gets_our_images(ros2: Ros2Transport, stock: Stock, reliability: str):
    qos = QoSProfile(depth=5, reliability=ReliabilityPolicy[reliability])
    heard = stock.hear(ImageMessage, "/shown", qos)
    publisher = ros2.advertise("shown", IMAGE)
    wait_for(lambda: publisher.connections, "the subscriber")
    sent = picture(3, 500_000)
    publisher.publish(sent)

    def is_there() -> bool:
        if reliability == "BEST_EFFORT":  # which may lose a piece of it
            publisher.publish(sent)
        return stock.spin() and bool(heard)

    wait_for(is_there, "the image")
    got = heard[0]
    assert (got.header.stamp.sec, got.header.stamp.nanosec) == (3, 7)
    assert (got.header.frame_id, got.encoding) == ("camera", "bgr8")
    assert (got.height, got.width, got.step) == (4, 500_000, 1_500_000)
    assert bytes(got.data) == sent.pixels.tobytes()
    publisher.close()


@pytest.mark.parametrize("reliability", ["RELIABLE", "BEST_EFFORT"])
def test_we_get_what_stock_publishers_send_however_they_do(
    ros2: Ros2Transport, stock: Stock, reliability: str
):
    qos = QoSProfile(depth=5, reliability=ReliabilityPolicy[reliability])
    heard: list[Image] = []
    refused: list[str] = []
    listening = ros2.subscribe("told", Image, heard.append, refused.append)
    publisher = stock.node.create_publisher(ImageMessage, "/told", qos)
    message = ImageMessage(height=1, width=2, step=2, encoding="mono8", data=[1, 2])
    wait_for(lambda: publisher.publish(message) or heard, "an image")
    assert heard[0].pixels.tolist() == [[1, 2]]
    message.step = 1
    wait_for(lambda: publisher.publish(message) or refused, "a refusal")
    assert "needs 2 bytes" in refused[0]
    listening.close()


def test_a_change_of_what_is_offered_loses_nothing_and_repeats_nothing(
    ros2: Ros2Transport, stock: Stock
):
    heard: list[Text] = []
    listening = ros2.subscribe("counted", Text, heard.append, pytest.fail)
    profiles = [QoSProfile(depth=50), QoSProfile(depth=50, reliability=ReliabilityPolicy(2))]
    first, second = (stock.node.create_publisher(String, "/counted", one) for one in profiles)
    wait_for(lambda: first.get_subscription_count(), "the subscriber")
    wait_for(lambda: second.get_subscription_count(), "the subscriber of the other")
    sent = [str(number) for number in range(60)]
    for number in sent:
        first.publish(String(data=number))
        stock.spin()
    wait_for(lambda: len(heard) >= len(sent), "all of them")
    assert [one.text for one in heard] == sent
    listening.close()


def test_a_consumer_that_fails_misses_that_message_alone(ros2: Ros2Transport, stock: Stock):
    heard: list[str] = []

    def take(text: Text) -> None:
        if text.text == "bad":
            raise KeyError("bad")
        heard.append(text.text)

    listening = ros2.subscribe("judged", Text, take, pytest.fail)
    publisher = stock.node.create_publisher(String, "/judged", 10)
    wait_for(lambda: publisher.get_subscription_count(), "the subscriber")
    for text in ("good", "bad", "better"):
        publisher.publish(String(data=text))
    wait_for(lambda: "better" in heard, "the last one")
    assert heard == ["good", "better"]
    listening.close()
    [failure] = supervision.PROCESS.failures
    assert (failure.who, failure.kind) == ("/judged", "KeyError")
    supervision.PROCESS.forget()


def test_large_messages_that_are_skipped_are_counted(ros2: Ros2Transport, stock: Stock):
    heard: list[Image] = []
    busy = threading.Event()
    listening = ros2.subscribe(
        "large", Image, lambda i: heard.append(i) or busy.wait(), pytest.fail
    )
    publisher = stock.node.create_publisher(ImageMessage, "/large", 10)
    wait_for(lambda: publisher.get_subscription_count(), "the subscriber")
    data = array("B", bytes(2_000_000))
    for number in range(4):
        message = ImageMessage(height=1, width=2_000_000, step=2_000_000, encoding="mono8")
        message.data, message.header.stamp.sec = data, number
        publisher.publish(message)
        wait_for(lambda: heard, "the first one")
    publisher.wait_for_all_acked()
    busy.set()
    wait_for(lambda: heard[-1].header.stamp_ns == 3 * NS, "the newest")
    assert len(heard) + listening.dropped == 4
    assert listening.dropped > 0
    listening.close()


def test_who_comes_late_gets_what_is_latched(ros2: Ros2Transport, stock: Stock):
    publisher = ros2.advertise("latched", TopicType(TEXT, qos=LATCHED))
    publisher.publish(Text("kept"))
    local = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    late = stock.hear(String, "/latched", local)
    heard: list[Text] = []
    listening = ros2.subscribe("latched", Text, heard.append, pytest.fail)
    wait_for(lambda: stock.spin() and late, "the text, elsewhere")
    wait_for(lambda: heard, "the text, here")
    assert (late[0].data, heard[0].text) == ("kept", "kept")
    listening.close()
    publisher.close()


def test_a_subscriber_that_gets_nothing_is_told_of(
    ros2: Ros2Transport, stock: Stock, caplog: pytest.LogCaptureFixture
):
    publisher = ros2.advertise("unheard", TopicType(TEXT, qos=QoS(reliable=False)))
    with caplog.at_level(logging.WARNING):
        stock.hear(String, "/unheard", QoSProfile(depth=1))
        wait_for(lambda: "/unheard" in caplog.text, "the warning")
    assert "/stock requests reliable, but /tests offers best effort" in caplog.text
    publisher.close()


def test_a_publisher_waits_for_nobody_and_counts_what_is_dropped(ros2: Ros2Transport):
    publisher = ros2.advertise("fast", IMAGE)
    big = Image(np.zeros((2000, 2000, 3), np.uint8), "bgr8")
    for _ in range(200):
        publisher.publish(big)
    assert publisher.dropped > 0
    publisher.flush(20)
    publisher.close()
    publisher.publish(big)  # to nobody


def test_a_type_that_is_not_installed_is_told_with_what_to_install(ros2: Ros2Transport):
    with pytest.raises(UsageError, match=r"ros-\$ROS_DISTRO-no-such-msgs"):
        ros2.subscribe("x", type("Odd", (Text,), {"type_name": "no_such_msgs/msg/A"}), print, print)


def test_a_recorded_name_that_ros_refuses_is_changed_and_told(
    ros2: Ros2Transport, caplog: pytest.LogCaptureFixture
):
    publisher = ros2.advertise("/ORB-SLAM/0 left", IMAGE)
    assert publisher.name == "/ORB_SLAM/_0_left"
    assert "/ORB-SLAM/0 left renamed to /ORB_SLAM/_0_left" in caplog.text
    publisher.close()


def test_a_recorded_type_that_is_not_installed_is_left_out(
    ros2: Ros2Transport, caplog: pytest.LogCaptureFixture
):
    types = Definitions("ros1")
    types.define("odd_msgs/msg/Odd", "float64 x")
    publisher = ros2.advertise("odd", TopicType("odd_msgs/msg/Odd", types))
    assert publisher.connections == 0
    assert "ros-$ROS_DISTRO-odd-msgs" in caplog.text
    publisher.close()


class ClosedMeanwhile(Waitable):  # type: ignore[misc]
    """What another thread closes just as the executor begins to wait for it."""

    def __init__(self, node: Node) -> None:
        super().__init__(node.default_callback_group)
        self.met = threading.Event()

    def is_ready(self, wait_set: Any) -> bool:
        return False

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities()

    def add_to_wait_set(self, wait_set: Any) -> None:
        if not self.met.is_set():
            self.met.set()
            raise rclpy_implementation.InvalidHandle("destruction was requested")


def test_what_is_closed_as_callbacks_are_awaited_is_no_failure(ros2: Ros2Transport):
    node = ros2.session.node
    closed = ClosedMeanwhile(node)
    node.add_waitable(closed)
    wait_for(lambda: ros2.advertise("brief", TopicType(TEXT)).close() or closed.met.is_set(), "it")
    with closing(ros2.offer("~again", lambda: None)):
        other = Ros2Transport(Ros2Session("other", []))
        other.call("/tests/again")
        other.close()
    node.remove_waitable(closed)
    assert not supervision.PROCESS.failures
