"""Transforms and texts in messages of tf2_msgs, geometry_msgs and std_msgs, and back."""

from dataclasses import replace

import numpy as np
from rosbags.highlevel import AnyReader
from through import HEADER, ROS1, assert_same, assert_survives, through_ros1, through_ros2

from ros_visualise.data import Header, Number, Text, Transforms, TransformStamped
from ros_visualise.messages import from_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.numeric_fields import numeric_fields

TRANSFORM = TransformStamped(
    "lidar", np.array([1.5, -2, np.nan]), np.array([0, 0, 0.6, 0.8]), HEADER
)


def test_a_transform_survives():
    assert_survives(TRANSFORM)


def test_several_transforms_survive_in_order():
    other = replace(TRANSFORM, child_frame_id="", header=Header(5, "map"))
    for through in (through_ros1, through_ros2):
        found = from_message(through(Transforms((TRANSFORM, other))), Transforms)
        assert len(found.transforms) == 2
        assert_same(found.transforms[0], TRANSFORM)
        assert_same(found.transforms[1], other)
        assert found.header == HEADER
        assert from_message(through(Transforms(())), Transforms).transforms == ()


def test_what_tf_sent_before_tf2_is_read():
    types = Definitions("ros1")
    types.define("tf/msg/tfMessage", "geometry_msgs/TransformStamped[] transforms")
    data = ROS1.write(Transforms.type_name, through_ros1(Transforms((TRANSFORM,))))
    old = types.read("tf/msg/tfMessage", bytes(data))
    assert_same(from_message(old, Transforms).transforms[0], TRANSFORM)


def test_the_type_of_transforms_is_that_of_ros(recordings):
    """The library lacks the definition for ROS 1; a bag from a robot holds its digest."""
    with AnyReader([recordings / "bags" / "evo_tf_example.bag"]) as reader:
        digests = {connection.digest for connection in reader.connections}
    assert digests == {ROS1.digest("tf2_msgs/msg/TFMessage")}


def test_texts_survive():
    for text in ("", "<robot>ä 漢</robot>", "x" * 100_000):
        assert_survives(Text(text))


def test_numbers_survive_and_can_be_plotted():
    for number in (0.0, -2.5, 1e300):
        assert_survives(Number(number))
    assert numeric_fields(through_ros1(Number(2.5))) == {"data": 2.5}
