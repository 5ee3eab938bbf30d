"""The node `place_recognizer`: places on a drawn flight, by an odometry that comes later."""

import numpy as np
from visual_flight import Flight

from ros_visualise.data import Header, Image, Odometry, Transforms, TransformStamped
from ros_visualise.geometry import se3
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.place_recognizer import PlaceParams, PlaceRecognizer

PERIOD_NS = 200_000_000
NUMBERS = [*range(0, 40, 2), *range(37, 5, -2)]


def odometry(k, n, variance=0.01):
    """The exact pose of the camera, as that of the robot, 50 ms after an image."""
    flight = Flight()
    place, quat = se3.to_pose(se3.from_parts(flight.R(n), flight.p(n)))
    at, twist = Header(k * PERIOD_NS + 50_000_000, "odom"), np.eye(6) * variance
    return Odometry(place, quat, np.zeros(3), np.zeros(3), np.eye(6), twist, "base_link", at)


def recognized(lost=(), calibrated=True):
    """The node, and its answers to odometry."""
    flight, frames, params = Flight(), FrameTree(), PlaceParams()
    level = np.array([0.0, 0, 0, 1])
    at = TransformStamped("camera", np.zeros(3), level, Header(0, "base_link"))
    frames.add(Transforms((at,)), True)
    node, found = PlaceRecognizer(params), []
    node.step(params, odometry=odometry(-1, 0), frames=frames)
    for k, n in enumerate(NUMBERS):
        info = flight.info if calibrated else None
        image = Image(flight.image(n), "mono8", Header(k * PERIOD_NS, "camera"), camera_info=info)
        assert node.step(params, image=image, frames=frames) is None  # its odometry is missing
        spread = 1e6 if k in lost else 0.01
        found.append(node.step(params, odometry=odometry(k, n, spread), frames=frames))
    return node, found


def test_places_are_landmarks_with_a_pose_in_the_camera():
    node, found = recognized()
    assert node.report()["recognized"] >= 3
    messages = [one["places"] for one in found if one]
    stamps = [one.header.stamp_ns for one in messages]
    assert stamps == sorted(set(stamps))
    assert all(stamp_ns % PERIOD_NS == 0 for stamp_ns in stamps)  # those of the images
    seen = [detection for one in messages for detection in one.detections]
    assert len({one.class_id for one in seen}) == node.report()["places"]
    assert all(one.class_id == f"place_{one.id}" for one in seen)
    (pose,) = seen[-1].hypotheses
    assert 1 < pose.position_xyz[2] < 8
    assert np.linalg.eigvalsh(pose.covariance).min() > 0


def test_a_lost_odometry_interrupts_and_gives_no_places():
    node, found = recognized(lost=range(3, 30))
    assert not any(found[3:30])
    assert node.report()["views"] < len(NUMBERS) - 20


def test_an_uncalibrated_camera_has_no_places(caplog):
    node, found = recognized(calibrated=False)
    assert not any(found)
    assert node.report() == {}
    assert "no places: the camera is not calibrated" in caplog.text
