"""The two ends of a topic of images, by stock rclpy or by our transport.

    python ends.py publish rclpy|ours|plain WIDTHxHEIGHT --rate R
    python ends.py subscribe rclpy|ours|count TOPIC --seconds S --warmup W

The subscriber prints one JSON object. Images are as old as their stamps say, which a publisher
takes from the time of day just before it publishes. ``plain`` is our transport, whose bytes rclpy
sends instead of ROS 2's C library by itself. ``count`` is for a topic of calibrations, whose
bytes are taken and not looked at.
"""

import argparse
import array
import json
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo
from sensor_msgs.msg import Image as RosImage

from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.ros2 import rcl
from ros_visualise.runtime.ros2.session import Ros2Session
from ros_visualise.runtime.ros2.transport import Ros2Transport

TYPE = TopicType("sensor_msgs/msg/Image")
TOPIC = "image_raw"
_DIFFERENT = 4
_PATIENCE_S = 60


def pictures(size: str) -> list[np.ndarray]:
    """Some images of noise, (height, width, 3) uint8."""
    width, height = map(int, size.split("x"))
    random = np.random.default_rng(0)
    return [random.integers(0, 256, (height, width, 3), np.uint8) for _ in range(_DIFFERENT)]


def paced(rate: float) -> Iterator[int]:
    """Numbers, that many in a second; one that is late is not made up for."""
    due_s, number = time.monotonic(), 0
    while True:
        yield number
        number += 1
        due_s = max(due_s + 1 / rate, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))


def publish_rclpy(size: str, rate: float) -> None:
    """As fast as rclpy can: the data are arrays, made before."""
    node = rclpy.create_node("publisher")
    publisher = node.create_publisher(RosImage, TOPIC, QoSProfile(depth=1))
    messages = [_ros_image(pixels) for pixels in pictures(size)]
    for number in paced(rate):
        message = messages[number % _DIFFERENT]
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)


def publish_ours(size: str, rate: float) -> None:
    transport = Ros2Transport(Ros2Session("publisher", []))
    publisher = transport.advertise(TOPIC, TYPE)
    images = pictures(size)
    for number in paced(rate):
        header = Header(time.time_ns(), "camera_optical")
        publisher.publish(Image(images[number % _DIFFERENT], "bgr8", header))


def publish_plain(size: str, rate: float) -> None:
    rcl.publish = lambda publisher, data: publisher.publish(data.tobytes())
    publish_ours(size, rate)


class Ages:
    """How old images are when they come; each is looked at, to be sure that it is there."""

    def __init__(self) -> None:
        self.taken: list[tuple[float, float]] = []
        self.first = threading.Event()

    def take(self, stamp_ns: int, pixels: np.ndarray) -> None:
        assert pixels.size
        pixels.reshape(-1)[:: 1 << 12].sum()
        self.taken.append((time.monotonic(), (time.time_ns() - stamp_ns) / 1e6))
        self.first.set()


def subscribe_rclpy(topic: str, ages: Ages) -> Callable[[], None]:
    node = rclpy.create_node("subscriber")

    def take(message: RosImage) -> None:
        stamp = message.header.stamp
        ages.take(stamp.sec * 10**9 + stamp.nanosec, np.frombuffer(message.data, np.uint8))

    node.create_subscription(RosImage, topic, take, QoSProfile(depth=1))
    return _spun(node)


def subscribe_count(topic: str, ages: Ages) -> Callable[[], None]:
    node = rclpy.create_node("subscriber")

    def take(_: bytes) -> None:
        ages.taken.append((time.monotonic(), float("nan")))
        ages.first.set()

    node.create_subscription(CameraInfo, topic, take, QoSProfile(depth=100), raw=True)
    return _spun(node)


def subscribe_ours(topic: str, ages: Ages) -> Callable[[], None]:
    transport = Ros2Transport(Ros2Session("subscriber", []))
    transport.subscribe(
        topic, Image, lambda image: ages.take(image.header.stamp_ns, image.data), print
    )
    return lambda: transport.close()


def _spun(node: Node) -> Callable[[], None]:
    """Has a node take its messages; returns the call that ends it."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    ended = threading.Event()

    def spin() -> None:
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)

    spinning = threading.Thread(target=spin)
    spinning.start()

    def end() -> None:
        ended.set()
        spinning.join()
        rclpy.shutdown()

    return end


def figures(ages: Ages, warmup_s: float, seconds: float) -> dict[str, float]:
    """Images in a second, and how old they were, milliseconds."""
    if not ages.first.wait(_PATIENCE_S):
        return {"fps": 0.0}
    time.sleep(warmup_s)
    before = len(ages.taken)
    time.sleep(seconds)
    taken = np.array(ages.taken[before:])
    if len(taken) < 2:
        return {"fps": 0.0}
    p50_ms, p99_ms = np.percentile(taken[:, 1], (50, 99))
    fps = (len(taken) - 1) / (taken[-1, 0] - taken[0, 0])
    return {"fps": fps, "p50_ms": p50_ms, "p99_ms": p99_ms}


PUBLISHERS = {"rclpy": publish_rclpy, "ours": publish_ours, "plain": publish_plain}
SUBSCRIBERS = {"rclpy": subscribe_rclpy, "ours": subscribe_ours, "count": subscribe_count}


def _ros_image(pixels: np.ndarray) -> RosImage:
    height, width, _ = pixels.shape
    message = RosImage(height=height, width=width, encoding="bgr8", step=3 * width)
    message.header.frame_id = "camera_optical"
    message.data = array.array("B", pixels.tobytes())
    return message


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    ends = parser.add_subparsers(dest="end", required=True)
    publisher = ends.add_parser("publish")
    publisher.add_argument("kind", choices=PUBLISHERS)
    publisher.add_argument("size")
    publisher.add_argument("--rate", type=float, required=True)
    subscriber = ends.add_parser("subscribe")
    subscriber.add_argument("kind", choices=SUBSCRIBERS)
    subscriber.add_argument("topic")
    subscriber.add_argument("--seconds", type=float, required=True)
    subscriber.add_argument("--warmup", type=float, required=True)
    args = parser.parse_args()
    if args.kind not in ("ours", "plain"):
        rclpy.init()
    if args.end == "publish":
        PUBLISHERS[args.kind](args.size, args.rate)
    else:
        ages = Ages()
        end = SUBSCRIBERS[args.kind](args.topic, ages)
        print(json.dumps(figures(ages, args.warmup, args.seconds)))
        end()


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None
