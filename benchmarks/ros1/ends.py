"""The two ends of a topic, by stock rospy or by our transport.

    python ends.py publish rospy|ours VIDEO [--rate R]
    python ends.py subscribe rospy|ours PID_OF_THE_PUBLISHER --seconds S --warmup W

A publisher without a rate goes as fast as it can. The subscriber prints one JSON object.
"""

import argparse
import json
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rospy
from measure import processor_s
from sensor_msgs.msg import Image
from source import message, read

from ros_visualise.runtime.ros1 import topics


def sender(kind: str) -> Callable[[Image], None]:
    """What publishes an image and waits until it is with the subscriber's socket."""
    if kind == "rospy":  # without a queue its publish() waits, which is also its fastest
        return rospy.Publisher("image_raw", Image, queue_size=None).publish
    publisher = topics.Ros1Publisher("image_raw", Image)

    def send(image: Image) -> None:
        publisher.publish(image)
        publisher.flush(1.0)

    return send


def publish(kind: str, path: Path, rate: float | None) -> None:
    messages = [message(image) for image in read(path)]
    if kind == "rospy":
        for one in messages:
            one.data = bytes(one.data)
    send = sender(kind)
    due_s, number = time.monotonic(), 0
    while not rospy.is_shutdown():
        if rate:
            due_s = max(due_s + 1 / rate, time.monotonic() - 1 / rate)
            time.sleep(max(0.0, due_s - time.monotonic()))
        send(messages[number % len(messages)])
        number += 1


class Counter:
    """Counts images; touches each to be sure that it is there."""

    def __init__(self) -> None:
        self.count = 0
        self.first = threading.Event()

    def take(self, image: Image) -> None:
        pixels = np.frombuffer(image.data, np.uint8)
        assert len(pixels) == image.step * image.height
        self.count += 1
        self.first.set()


def subscribe(kind: str, publisher: int, warmup_s: float, seconds: float) -> dict[str, float]:
    counter = Counter()
    if kind == "ours":
        topics.Ros1Subscriber("image_raw", Image, counter.take)
    else:
        rospy.Subscriber("image_raw", Image, counter.take, queue_size=1)
    if not counter.first.wait(15):
        return {"fps": 0.0}
    time.sleep(warmup_s)
    before = (counter.count, time.monotonic(), processor_s([publisher]), processor_s([os.getpid()]))
    time.sleep(seconds)
    after = (counter.count, time.monotonic(), processor_s([publisher]), processor_s([os.getpid()]))
    count, wall_s, sent_s, taken_s = (b - a for a, b in zip(before, after, strict=True))
    if not count:
        return {"fps": 0.0}
    return {
        "fps": count / wall_s,
        "publisher_ms": sent_s / count * 1e3,
        "subscriber_ms": taken_s / count * 1e3,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    kinds = ("rospy", "ours")
    ends = parser.add_subparsers(dest="end", required=True)
    publisher = ends.add_parser("publish")
    publisher.add_argument("kind", choices=kinds)
    publisher.add_argument("video", type=Path)
    publisher.add_argument("--rate", type=float)
    subscriber = ends.add_parser("subscribe")
    subscriber.add_argument("kind", choices=kinds)
    subscriber.add_argument("publisher", type=int)
    subscriber.add_argument("--seconds", type=float, required=True)
    subscriber.add_argument("--warmup", type=float, required=True)
    args = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node(args.end, anonymous=True)
    if args.end == "publish":
        publish(args.kind, args.video, args.rate)
    else:
        print(json.dumps(subscribe(args.kind, args.publisher, args.warmup, args.seconds)))


if __name__ == "__main__":
    main()
