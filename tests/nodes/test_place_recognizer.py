"""The node `place_recognizer`: places on a drawn flight, by an odometry that comes later."""

from dataclasses import replace

import numpy as np
from visual_flight import Flight

from ros_visualise.data import Header, Image, Odometry, Transforms, TransformStamped
from ros_visualise.estimation.localization import map_file
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.visual.place_file import PlaceLook, places_path, to_bytes
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


def tree():
    """The camera is where the robot is."""
    frames, level = FrameTree(), np.array([0.0, 0, 0, 1])
    at = TransformStamped("camera", np.zeros(3), level, Header(0, "base_link"))
    frames.add(Transforms((at,)), True)
    return frames


def recognized(lost=(), calibrated=True):
    """The node, and its answers to odometry."""
    flight, frames, params = Flight(), tree(), PlaceParams()
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


def test_all_images_before_a_slow_odometry_are_answered_one_a_step():
    flight, frames, params = Flight(), tree(), PlaceParams()
    node, answers = PlaceRecognizer(params), []
    node.step(params, odometry=odometry(-1, 0), frames=frames)
    for k in range(3):
        header = Header(k * PERIOD_NS, "camera")
        image = Image(flight.image(k), "mono8", header, camera_info=flight.info)
        node.step(params, image=image, frames=frames)
    for k in range(2, 6):
        answers.append(node.step(params, odometry=odometry(k, k), frames=frames))
    stamps = [one["places"].header.stamp_ns for one in answers if one]
    assert stamps == [0, PERIOD_NS, 2 * PERIOD_NS]


def test_a_map_that_cannot_be_read_in_flight_leaves_only_new_places(tmp_path, caplog):
    path, params = tmp_path / "field.yaml", PlaceParams(map=str(tmp_path / "field.yaml"))
    write_map(path)
    node = PlaceRecognizer(params)
    assert len(node._known) == 1
    bad = replace(params, map=str(tmp_path / "none.yaml"))
    for _ in range(2):
        assert node.step(bad, odometry=odometry(0, 0), frames=tree()) is None
    assert node._known == []
    assert caplog.text.count("none.yaml: no such file") == 1
    assert "until then recognizing only new places" in caplog.text
    node.step(params, odometry=odometry(1, 0), frames=tree())
    assert len(node._known) == 1


def write_map(path):
    look = PlaceLook(np.ones((60, 32), np.uint8), np.zeros((60, 2)), np.ones(60))
    at = np.zeros(3), np.eye(3), np.eye(6)
    track = LandmarkTrack.of_map((f"place_{look.id}", -1), at, np.zeros(3), 1)
    path.write_text(map_file.to_text("map", [track]))
    places_path(path).write_bytes(to_bytes([look]))
