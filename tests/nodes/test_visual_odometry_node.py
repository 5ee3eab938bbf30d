"""The node `visual_odometry` on a drawn flight: metres, losses, and nothing without a scale."""

import numpy as np
import pytest
from visual_flight import HEIGHT, Flight

from ros_visualise.data import Header, Image, Transforms, TransformStamped
from ros_visualise.geometry import rotations, se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.visual_odometry import CameraMotionParams, VisualOdometryNode

PERIOD_NS = 100_000_000


def answers(params, images):
    """The node's answers to images of a camera that is placed on the robot by tf."""
    flight, frames = Flight(), FrameTree()
    quat = rotations.from_matrix(flight.R(0))
    place = TransformStamped("camera", np.zeros(3), quat, Header(0, "base_link"))
    frames.add(Transforms((place,)), True)
    node = VisualOdometryNode(params)
    found = []
    for number, pixels in enumerate(images):
        header = Header(number * PERIOD_NS, "camera")
        image = Image(pixels, "mono8", header, camera_info=flight.info)
        found.append(node.step(params, image=image, frames=frames))
    return found


@pytest.fixture(scope="module")
def images():
    return [Flight().image(number) for number in range(14)]


def test_publishes_metres_and_reports_a_loss(images):
    flight, dark = Flight(), np.zeros_like(images[0])
    params = CameraMotionParams(height=HEIGHT, corners=120)
    found = answers(params, [*images, dark, dark])
    odometry = found[13]["odometry"]
    T_first_last = se3.from_parts(*flight.motion(0, 13))
    T_base_camera = se3.from_parts(flight.R(0), np.zeros(3))
    true = (T_base_camera @ T_first_last @ se3.inverse(T_base_camera))[:3, 3]
    assert np.linalg.norm(odometry.position_xyz - true) < 0.05 * np.linalg.norm(true)
    assert odometry.linear_xyz[0] == pytest.approx(1.2, rel=0.1)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("visual_odom", "base_link")
    assert np.linalg.eigvalsh(odometry.pose_covariance).min() > 0
    assert found[13]["diagnostics"].statuses[0].message == "located"
    assert found[13]["debug_image"].pixels.shape == (240, 320, 3)
    points = next(one["points"] for one in reversed(found) if "points" in one)
    assert np.abs(points.xyz[:, 2] + HEIGHT).max() < 0.2
    lost = found[15]["odometry"]
    assert np.trace(lost.pose_covariance) > np.trace(odometry.pose_covariance)
    assert lost.twist_covariance[0, 0] > 1e3
    assert found[15]["diagnostics"].statuses[0].message == "too dark"


def test_publishes_no_odometry_without_a_scale(images):
    found = answers(CameraMotionParams(corners=120), images[:6])
    assert not any("odometry" in one or "points" in one or "tf" in one for one in found)
    assert "scale unknown" in found[-1]["diagnostics"].statuses[0].message
