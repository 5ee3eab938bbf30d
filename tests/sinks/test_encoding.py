"""What is written of types that ROS 2 names and bounds as ROS 1 cannot."""

import numpy as np
import pytest

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Header, PoseStamped
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks.encoding import Encoder

LINE = "=" * 80
ROS2_NAME, ROS1_NAME = "walk_msgs/action/Walk_Message", "walk_msgs/msg/Walk_Message"
ROS2_TEXT = f"""string<=10 label
walk_msgs/action/Walk_Feedback feedback
{LINE}
MSG: walk_msgs/action/Walk_Feedback
int32[<=3] steps
float32[2] place
"""
ROS1_TEXT = f"""string label
walk_msgs/Walk_Feedback feedback
{LINE}
MSG: walk_msgs/Walk_Feedback
int32[] steps
float32[2] place
"""


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("stamp_ns", [-1, 2**31 * 10**9])
def test_a_stamp_that_ros_cannot_hold_costs_that_message_alone(encoding, stamp_ns):
    encoder, pose = Encoder(encoding), ([0.0, 0, 0], [0.0, 0, 0, 1])
    with pytest.raises(DamagedMessage, match="a stamp of"):
        encoder.encode(PoseStamped(*pose, Header(stamp_ns)))
    assert encoder.encode(PoseStamped(*pose, Header(5)))


def test_ros1_has_names_of_two_parts_and_no_bounds() -> None:
    ros2, ros1 = Definitions("cdr"), Definitions("ros1")
    ros2.define(ROS2_NAME, ROS2_TEXT)
    ros1.define(ROS1_NAME, ROS1_TEXT)
    encoder = Encoder("ros1")
    declared = encoder.declare(TopicType(ROS2_NAME, ros2))
    assert (declared.name, declared.text) == (ROS1_NAME, ROS1_TEXT)
    assert declared.digest == ros1.digest(ROS1_NAME)

    part = ros2.types["walk_msgs/action/Walk_Feedback"](np.array([1, 2], np.int32), np.ones(2, "f"))
    data = ros2.write(ROS2_NAME, ros2.types[ROS2_NAME]("far", part))
    found = ros1.read(ROS1_NAME, encoder.encode(Recorded(ROS2_NAME, data, ros2, 5)))
    assert (found.label, found.feedback.steps.tolist()) == ("far", [1, 2])
    assert found.feedback.place.tolist() == [1, 1]


def test_names_of_three_parts_are_not_kept_in_ros1() -> None:
    given = Definitions("ros1")
    comment = "# see walk_msgs/action/Walk\n"
    given.define(ROS2_NAME, comment + ROS1_TEXT.replace("walk_msgs/", "walk_msgs/msg/"))
    declared = Encoder("ros1").declare(TopicType(ROS2_NAME, given))
    assert (declared.name, declared.text) == (ROS1_NAME, comment + ROS1_TEXT)


def test_what_ros1_cannot_name_is_said() -> None:
    given = Definitions("ros1")
    given.define(ROS2_NAME, ROS2_TEXT)
    with pytest.raises(DamagedMessage, match="Walk_Message: ROS 1 cannot hold this type"):
        Encoder("ros1").declare(TopicType(ROS2_NAME, given))


def test_ros2_keeps_its_names() -> None:
    ros2 = Definitions("cdr")
    ros2.define(ROS2_NAME, ROS2_TEXT)
    declared = Encoder("cdr").declare(TopicType(ROS2_NAME, ros2))
    assert (declared.name, declared.text) == (ROS2_NAME, ROS2_TEXT)
