"""The node that tells where landmarks are: frames, messages, its map, and what it says."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.core.errors import NoTransform, OpenError
from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Header,
    Hypothesis,
    Odometry,
    Transforms,
    TransformStamped,
)
from ros_visualise.data.markers import MarkerAction, MarkerType
from ros_visualise.estimation.localization import map_file
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.geometry.rotations import from_matrix, from_rpy, to_matrix
from ros_visualise.nodes.landmark_localizer import LandmarkLocalizer, LocalizerParams

PARAMS = LocalizerParams(attitude_sigma=0.01, position_sigma=0.001)
LEVEL = np.array([0.0, 0, 0, 1])
DOWN = from_matrix(np.diag([1.0, -1.0, -1.0]))
S = 1_000_000_000
INFO = CameraInfo(640, 480, K=np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]))
NOISE = np.diag([1e-4, 1e-4, 4e-4, 1e-4, 1e-4, 1e-4])


def tree(fixed="map", height=5.0, x=0.0):
    """A camera that looks down from over the point (x, 0) of the fixed frame."""
    frames = FrameTree()
    mounted = TransformStamped("camera", np.array([x, 0, height]), DOWN, Header(0, fixed))
    frames.add(Transforms((mounted,)), static=True)
    return frames


def tag(at, number=3, info=INFO):
    """One that lies flat, 0.4 m wide, at (x, y) of the camera and 5 m below it."""
    u, v = 320 + 100 * at[0], 240 + 100 * at[1]
    corners = np.array([[u - 20, v + 20], [u + 20, v + 20], [u + 20, v - 20], [u - 20, v - 20]])
    pose = np.array([*at, 5.0]), from_matrix(np.diag([1.0, -1, -1])), NOISE
    found = Hypothesis(f"tag36h11_{number}", 1.0, *pose, number)
    return Detection.of_corners(corners, [found], str(number))


def message(time_s, *found, frame="camera", info=INFO):
    return Detections(tuple(found), Header(round(time_s * S) + S, frame), info)


def observe(node, count=3, frames=None, params=PARAMS, start=0, **rest):
    answers = [
        node.step(
            params,
            detections=message(start + number / 10, tag((1.0, 0.5)), **rest),
            frames=frames or tree(),
        )
        for number in range(count)
    ]
    return answers[-1]


def test_landmarks_are_told_with_pose_covariance_class_and_size():
    answer = observe(LandmarkLocalizer(PARAMS))
    landmarks = answer["landmarks"]
    assert landmarks.header == Header(round(1.2 * S), "map")
    (found,) = landmarks.detections
    assert (found.class_id, found.id, found.hypotheses[0].number) == ("tag36h11_3", "tag36h11_3", 3)
    np.testing.assert_allclose(found.position_xyz, [1, -0.5, 0], atol=1e-9)
    np.testing.assert_allclose(found.size_xyz, [0.4, 0.4, 0], atol=1e-6)
    np.testing.assert_allclose(found.hypotheses[0].covariance, NOISE / 3, atol=2e-6)


def test_without_a_calibration_the_size_is_not_known():
    (found,) = observe(LandmarkLocalizer(PARAMS), info=None)["landmarks"].detections
    np.testing.assert_array_equal(found.size_xyz, 0)


def test_frames_are_called_as_the_landmarks():
    (frame,) = observe(LandmarkLocalizer(PARAMS))["tf_static"].transforms
    assert (frame.header.frame_id, frame.child_frame_id) == ("map", "tag36h11_3")
    np.testing.assert_allclose(frame.translation_xyz, [1, -0.5, 0], atol=1e-9)


def test_the_ellipsoid_holds_95_percent():
    markers = observe(LandmarkLocalizer(PARAMS))["markers"].markers
    (ellipsoid,) = [one for one in markers if one.ns == "covariance"]
    assert ellipsoid.type == MarkerType.SPHERE
    random = np.random.default_rng(3)
    points = random.multivariate_normal(np.zeros(3), (NOISE / 3)[:3, :3], 20_000)
    inside = (
        np.square(points @ to_matrix(ellipsoid.quat_xyzw) / (ellipsoid.scale_xyz / 2)).sum(axis=1)
        < 1
    ).mean()
    assert 0.94 < inside < 0.96
    assert {one.ns for one in markers} == {"covariance", "box", "axes", "label"}
    (label,) = [one for one in markers if one.ns == "label"]
    assert label.text == "tag36h11_3"


def test_numbers_of_tags_and_of_other_things_are_not_confused():
    """On ROS 1 classes are numbers: tag 3 is not the third class of a network."""
    params = replace(PARAMS, class_prefix="tag36h11_")
    node, frames = LandmarkLocalizer(params), tree()
    for number in range(3):
        found = tag((1.0, 0.5))
        (known,) = found.hypotheses
        seen = message(
            number / 10, replace(found, id="", hypotheses=(replace(known, class_id="3"),))
        )
        node.step(params, detections=seen, frames=frames)
        answer = node.step(params, objects=seen, frames=frames)
    classes = {one.class_id for one in answer["landmarks"].detections}
    assert classes == {"tag36h11_3", "object_3"}


def test_what_moves_is_no_landmark(caplog):
    params = replace(PARAMS, moving="pad, tag36h11_3")
    node, frames = LandmarkLocalizer(params), tree()
    seen = [message(n / 10, tag((n / 5, 0.5)), tag((0.0, 1.0), 4)) for n in range(9)]
    for one in seen:
        answer = node.step(params, detections=one, frames=frames)
    assert [one.class_id for one in answer["landmarks"].detections] == ["tag36h11_4"]
    assert node.report()["skipped"] == {"moves": 9}
    assert caplog.text == ""


def test_nothing_is_drawn_anew_where_nothing_was_seen():
    node = LandmarkLocalizer(PARAMS)
    observe(node)
    answer = node.step(PARAMS, detections=message(1), frames=tree())
    assert len(answer["landmarks"].detections) == 1
    assert answer.keys() == {"landmarks"}


def test_after_a_jump_of_time_all_that_was_drawn_goes_and_that_is_said(caplog):
    node = LandmarkLocalizer(PARAMS)
    observe(node)
    node.reset()
    node.reset()
    assert [r.getMessage() for r in caplog.records] == [
        "time jumped: dropping 1 landmark; next time, call save_map first to keep them"
    ]
    answer = node.step(PARAMS, detections=message(0), frames=tree())
    assert answer["landmarks"].detections == ()
    assert [one.action for one in answer["markers"].markers] == [MarkerAction.DELETEALL]


def test_odom_serves_where_there_is_no_map_and_map_as_soon_as_there_is(caplog):
    node = LandmarkLocalizer(PARAMS)
    assert observe(node, frames=tree("odom"))["landmarks"].header.frame_id == "odom"
    assert [r.getMessage() for r in caplog.records] == [
        "no frame map; publishing landmarks in odom"
    ]
    answer = node.step(PARAMS, detections=message(1, tag((1.0, 0.5))), frames=tree())
    assert "frame changed to map: dropping 1 landmark" in caplog.text
    assert answer["landmarks"].header.frame_id == "map"
    assert answer["landmarks"].detections == ()
    with pytest.raises(NoTransform):
        node.step(PARAMS, detections=message(1, tag((1.0, 0.5)), frame="other"), frames=tree())


def test_two_cameras_see_one_landmark():
    frames = tree()
    other = TransformStamped("right", np.array([1.0, 0, 5]), DOWN, Header(0, "map"))
    frames.add(Transforms((other,)), static=True)
    node = LandmarkLocalizer(PARAMS)
    for number in range(4):
        left, right = tag((1.0, 0.5)), tag((0.0, 0.5))
        node.step(PARAMS, detections=message(number, left), frames=frames)
        answer = node.step(PARAMS, detections=message(number, right, frame="right"), frames=frames)
    (found,) = answer["landmarks"].detections
    np.testing.assert_allclose(found.position_xyz, [1, -0.5, 0], atol=1e-9)
    assert node.report() == {"landmarks": 1, "seen": {"tag36h11_3": 8}, "skipped": {}}


def test_an_odometry_says_how_sure_the_robot_is():
    node = LandmarkLocalizer(PARAMS)
    covariance = np.diag([0.25, 0.25, 0.01, 1e-6, 1e-6, 1e-6])
    odom = Odometry(
        np.array([0.0, 0, 5]), LEVEL, pose_covariance=covariance, header=Header(S, "map")
    )
    assert node.step(PARAMS, odom=odom, frames=tree()) is None
    (found,) = observe(node)["landmarks"].detections
    sure = np.diag(found.hypotheses[0].covariance)
    np.testing.assert_allclose(sure[:3], [0.25, 0.25, 0.01], atol=3e-3)


def test_images_that_come_late_are_taken_with_the_odometry_of_their_time():
    """A detector takes seconds on a busy machine, while odometry comes at once and drifts on."""
    node = LandmarkLocalizer(PARAMS)
    for second, sigma in enumerate((0.1, 5.0, 9.0)):
        covariance = np.diag([sigma**2] * 3 + [1e-6] * 3)
        header = Header(S + 2 * second * S, "map")
        place = np.array([0.0, 0, 5])
        odom = Odometry(place, LEVEL, pose_covariance=covariance, header=header)
        node.step(PARAMS, odom=odom, frames=tree())
    (found,) = observe(node)["landmarks"].detections
    assert np.sqrt(np.diag(found.hypotheses[0].covariance)[:2]) == pytest.approx(0.1, abs=0.02)


def test_the_ground_is_where_it_is_said():
    frames = tree()
    lake = TransformStamped("lake", np.array([0, 0, -3.0]), from_rpy([0, 0, 0]), Header(0, "map"))
    frames.add(Transforms((lake,)), static=True)
    params = replace(PARAMS, ground_frame="lake", ground_height=1.0, ground_sigma=0.05)
    node = LandmarkLocalizer(params)
    ray = np.array([0.6, 0, 0.8])
    spread = np.diag([1e-6] * 3 + [1e6] * 3)
    spread[:3, :3] += 1e6 * np.outer(ray, ray)
    seen = Detection(
        np.zeros(2), np.ones(2), hypotheses=(Hypothesis("pad", 0.9, ray, covariance=spread),)
    )
    for number in range(3):
        answer = node.step(params, detections=message(number, seen), frames=frames)
    (found,) = answer["landmarks"].detections
    assert found.id == "pad_1"
    np.testing.assert_allclose(found.position_xyz, [7 * 0.75, 0, -2], atol=1e-3)
    assert found.hypotheses[0].covariance[2, 2] == pytest.approx(0.05**2, rel=0.02)


def test_a_saved_map_loads_again(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    path = tmp_path / "pads.yaml"
    node, params = LandmarkLocalizer(PARAMS), replace(PARAMS, save_to=str(path))
    (before,) = observe(node)["landmarks"].detections
    for _ in range(2):  # the second in the place of the first
        node.save_map(params)
    assert f"1 landmarks saved to {path}" in caplog.text
    again = LandmarkLocalizer(replace(PARAMS, map=str(path)))
    for _ in range(2):
        (found,) = again.step(PARAMS, detections=message(0), frames=tree())["landmarks"].detections
        assert (found.id, found.class_id) == ("tag36h11_3", "tag36h11_3")
        for name in ("position_xyz", "quat_xyzw", "size_xyz"):
            np.testing.assert_allclose(getattr(found, name), getattr(before, name), atol=1e-12)
        pair = found.hypotheses[0].covariance, before.hypotheses[0].covariance
        np.testing.assert_allclose(*pair, rtol=1e-9, atol=1e-15)
        again.reset()
    (later,) = observe(again)["landmarks"].detections
    assert later.hypotheses[0].covariance[0, 0] < before.hypotheses[0].covariance[0, 0]
    assert list(tmp_path.iterdir()) == [path]


def test_landmarks_in_odom_are_saved_in_the_frame_of_a_map(tmp_path):
    node, params = LandmarkLocalizer(PARAMS), replace(PARAMS, save_to=str(tmp_path / "a.yaml"))
    observe(node, frames=tree("odom"))
    node.save_map(params)
    assert map_file.load(tmp_path / "a.yaml").frame_id == "map"


def test_without_landmarks_nothing_is_written(tmp_path, caplog):
    LandmarkLocalizer(PARAMS).save_map(replace(PARAMS, save_to=str(tmp_path / "none.yaml")))
    assert "nothing saved" in caplog.text
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "no such file"),
        ("a: [", "not YAML: "),
        ("- 1", "needs a frame_id and a list of landmarks"),
        ("frame_id: map\nlandmarks: [{}]", "landmark 1 is invalid: missing pose"),
        ("frame_id: world\nlandmarks: []", "are in the frame world; set fixed_frame=world"),
    ],
)
def test_what_is_no_map_is_said_in_one_line(tmp_path, text, says):
    path = tmp_path / "map.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(OpenError, match=says) as error:
        LandmarkLocalizer(replace(PARAMS, map=str(path)))
    assert "\n" not in str(error.value)
