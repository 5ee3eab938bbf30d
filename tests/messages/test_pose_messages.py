"""Poses, velocities and paths in messages of geometry_msgs and nav_msgs, and back."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from through import HEADER, ROS1, assert_survives, through_ros1

from ros_visualise.data import (
    Header,
    Odometry,
    Path,
    PoseStamped,
    PoseWithCovarianceStamped,
    Twist,
    TwistStamped,
    TwistWithCovarianceStamped,
)
from ros_visualise.messages import from_message, to_message


def numbers(*shape: int) -> Any:
    return np.random.default_rng(3).normal(size=shape)


ODOMETRY = Odometry(
    position_xyz=numbers(3),
    quat_xyzw=numbers(4),
    linear_xyz=numbers(3) + 1,
    angular_xyz=numbers(3) + 2,
    pose_covariance=numbers(6, 6),
    twist_covariance=numbers(6, 6) + 1,
    child_frame_id="base_link",
    header=HEADER,
)
POSE = PoseStamped(numbers(3), numbers(4), HEADER)
PATH = Path(np.array([0, 5, 1_700_000_000_123_456_789]), numbers(3, 3), numbers(3, 4) + 1, HEADER)
NO_PATH = Path(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 4)), HEADER)


UNCERTAIN = PoseWithCovarianceStamped(numbers(3), numbers(4), numbers(6, 6), HEADER)
SPEED = TwistStamped(numbers(3), numbers(3) + 1, HEADER)
SURE_SPEED = TwistWithCovarianceStamped(numbers(3), numbers(3) + 1, numbers(6, 6), HEADER)
COMMAND = Twist(numbers(3), numbers(3) + 1)


@pytest.mark.parametrize(
    "data",
    [ODOMETRY, POSE, PATH, NO_PATH, UNCERTAIN, SPEED, SURE_SPEED, COMMAND],
    ids=lambda data: type(data).__name__,
)
def test_poses_and_velocities_survive(data: Any) -> None:
    assert_survives(data)


def test_what_is_not_known_stays_so() -> None:
    assert_survives(
        replace(ODOMETRY, linear_xyz=np.full(3, np.nan), position_xyz=[0, np.inf, -0.0])
    )
    assert_survives(replace(UNCERTAIN, covariance=np.full((6, 6), -1.0)))


def test_velocities_asked_for_have_no_header_in_ros() -> None:
    assert from_message(through_ros1(replace(COMMAND, header=HEADER)), Twist).header == Header()


def test_the_poses_of_a_path_have_its_frame_and_times_of_their_own() -> None:
    first, second, third = through_ros1(PATH).poses
    assert {p.header.frame_id for p in (first, second, third)} == {HEADER.frame_id}
    assert (second.header.stamp.sec, second.header.stamp.nanosec) == (0, 5)
    assert (third.header.stamp.sec, third.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    with pytest.raises(ValueError, match=r"stamp of -1 s: .* between 1970 and 2038"):
        to_message(replace(PATH, stamps_ns=np.array([0, -1, 0])), ROS1.types)
