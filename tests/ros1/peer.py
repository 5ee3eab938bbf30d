"""A node of its own for the tests: ``peer.py publish|subscribe rospy|ours TOPIC [SIZE RATE]``.

Image number n has n for its seconds and, in each byte, n % 251. A subscriber prints a line for
each message: its numbers, its bytes, and whether they are what they should be.
"""

import contextlib
import json
from typing import Any

import numpy as np
import rospy
from sensor_msgs.msg import Image

from ros_visualise.runtime.ros1 import topics


def numbered(number: int, size: int) -> Image:
    """Image number n."""
    message = Image(height=1, width=size, encoding="mono8", step=size)
    message.header.stamp.secs = number
    message.data = np.full(size, number % 251, np.uint8)
    return message


def is_whole(message: Image) -> bool:
    """Whether it is image number n, all of it."""
    data = np.frombuffer(message.data, np.uint8)
    return len(data) == message.step and bool((data == message.header.stamp.secs % 251).all())


def tell(message: Image) -> None:
    header = message.header
    print(json.dumps([header.seq, header.stamp.secs, len(message.data), is_whole(message)]))


def publish(by: str, topic: str, size: str, rate: str) -> None:
    publisher: Any
    if by == "ours":
        publisher = topics.Ros1Publisher(topic, Image)
    else:
        publisher = rospy.Publisher(topic, Image, queue_size=1)
    number, pause = 0, rospy.Rate(float(rate))
    while not rospy.is_shutdown():
        number += 1
        message = numbered(number, int(size))
        if by == "rospy":
            message.data = message.data.tobytes()
        publisher.publish(message)
        pause.sleep()


def subscribe(by: str, topic: str) -> None:
    subscriber = topics.Ros1Subscriber if by == "ours" else rospy.Subscriber
    subscriber(topic, Image, tell)
    rospy.spin()


if __name__ == "__main__":
    role, *arguments = rospy.myargv()[1:]
    rospy.init_node(role, anonymous=True)
    with contextlib.suppress(rospy.ROSInterruptException):
        {"publish": publish, "subscribe": subscribe}[role](*arguments)
