"""The table of messages, and the classes that it fills."""

from typing import Any

import numpy as np
from through import ROS1, ROS2

from ros_visualise.core.message import topic_kinds
from ros_visualise.data import (
    Deferred,
    Image,
    Odometry,
    PointCloud,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.messages import data_class, to_message


def test_types_have_names_both_ways() -> None:
    assert Image.type_name == "sensor_msgs/msg/Image"
    assert data_class("sensor_msgs/msg/Image") is Image
    assert data_class("sensor_msgs/msg/Joy") is None
    assert data_class("tf/msg/tfMessage") is Transforms


def test_every_message_has_a_type_of_its_own() -> None:
    names = {cls.type_name for cls in topic_kinds()}
    assert len(names) == len(topic_kinds())
    assert {data_class(name) for name in names} == set(topic_kinds())
    for name in names - {"rcl_interfaces/msg/ParameterEvent"}:
        assert ROS1.knows(name)
    assert all(ROS2.knows(name) for name in names)


def test_every_message_tells_what_it_takes_to_let_it_wait() -> None:
    image = Image(np.zeros((100, 200), np.uint8), "mono8")
    assert 20_000 <= image.nbytes < 22_000
    assert Deferred((100, 200), np.uint8, lambda: np.zeros(0)).nbytes == 20_000
    frames = Transforms(
        tuple(TransformStamped(f"f{i}", np.zeros(3), np.zeros(4)) for i in range(9))
    )
    assert frames.nbytes > 9 * TransformStamped("f", np.zeros(3), np.zeros(4)).nbytes
    assert [kind for kind in topic_kinds() if kind.waiting == 1] == [PointCloud, Image]
    assert all(kind.waiting > 1 for kind in (Odometry, Text))


def test_classes_with_slots_are_filled() -> None:
    class Slotted:
        __slots__ = ("data", "encoding", "header", "height", "is_bigendian", "step", "width")

        def __init__(self, *values: Any) -> None:
            for name, value in zip(self.__slots__, values, strict=True):
                setattr(self, name, value)

    types = {**ROS1.types, "sensor_msgs/msg/Image": Slotted}
    found = to_message(Image(np.zeros((3, 5, 4), np.uint8), "rgba8"), types)
    assert (found.encoding, found.height, found.step, found.width) == ("rgba8", 3, 20, 5)
