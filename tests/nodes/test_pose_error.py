"""The node that holds an estimated pose against the truth."""

import numpy as np
import pytest

from ros_visualise.data import Header, Odometry, PoseWithCovarianceStamped
from ros_visualise.nodes import NoParams
from ros_visualise.nodes.pose_error import PoseError

LEVEL = np.array([0.0, 0, 0, 1])


def step(node, x, sigma=0.1, frame="map"):
    pose = PoseWithCovarianceStamped(
        np.array([x, 0, 0]), LEVEL, np.eye(6) * sigma**2, Header(7, "map")
    )
    truth = Odometry(np.zeros(3), LEVEL, header=Header(7, frame))
    return node.step(pose, truth, NoParams())


def test_metres_and_nees_of_each_pose_and_of_the_run():
    node = PoseError(NoParams())
    assert node.report() == {"rmse_m": None, "mean_nees": None, "inside_95": None}
    found = step(node, 0.3)
    assert found["error"].number == pytest.approx(0.3)
    assert found["nees"].number == pytest.approx(9)
    assert found["nees"].header.stamp_ns == 7
    step(node, 0.4)
    assert node.report() == {
        "rmse_m": pytest.approx(np.sqrt((0.09 + 0.16) / 2)),
        "mean_nees": pytest.approx(12.5),
        "inside_95": 0.5,  # 16 is beyond 14.4
    }
    node.reset()
    assert node.report()["rmse_m"] is None


def test_without_a_covariance_there_is_a_distance_alone():
    node = PoseError(NoParams())
    assert set(step(node, 0.3, sigma=0)) == {"error"}
    assert node.report()["mean_nees"] is None


def test_another_frame_is_said_once(caplog):
    node = PoseError(NoParams())
    assert step(node, 1, frame="odom") is None
    assert step(node, 1, frame="odom") is None
    assert caplog.text.count("the pose is in frame map, but the truth is in odom") == 1
