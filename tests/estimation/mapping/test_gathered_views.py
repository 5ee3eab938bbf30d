"""What a recording holds, as a problem."""

from dataclasses import replace

import numpy as np
from made_worlds import INFO, SIZE, corners_seen, hypothesis, turn

from ros_visualise.data import (
    Detection,
    Detections,
    Header,
    Transforms,
    TransformStamped,
)
from ros_visualise.estimation.mapping.mapping_data import MappingData
from ros_visualise.estimation.mapping.problem import RigCamera
from ros_visualise.geometry.se3 import from_parts
from ros_visualise.landmarks.pose import squares_poses

DOWN = np.diag([1.0, -1, -1])
TAG = from_parts(turn([0.4, 0.2, 0.1]), np.zeros(3))


def found_at(stamp_ns, x, names=("tag36h11_3",)):
    """The detections of an image 3 m above the tag, ``x`` metres beside it."""
    corners = corners_seen(from_parts(DOWN, [x, 0, 3]), TAG)
    [poses] = squares_poses(corners[None], [SIZE], INFO, [0.1])
    several = [replace(hypothesis(pose), class_id=name) for name in names for pose in poses]
    tags = tuple(
        Detection.of_corners(corners, [h for h in several if h.class_id == name], name[-1])
        for name in names
    )
    return Detections(tags, Header(stamp_ns, "camera"), INFO)


def moving(stamp_ns, x):
    """That the camera is there."""
    header = Header(stamp_ns, "map")
    return Transforms((TransformStamped("camera", np.array([x, 0, 3]), [1.0, 0, 0, 0], header),))


def test_the_camera_is_where_the_frames_say():
    gathered = MappingData()
    for number in range(4):
        gathered.add_frames(moving(number * 10**8, 0.1 * number), static=False)
        gathered.add_found(found_at(number * 10**8, 0.1 * number))
    gathered.add_found(found_at(10**10, 0.0))  # long after the last transform
    problem = gathered.problem(lambda _: SIZE, "map")
    assert problem.counts == (4, 1)
    np.testing.assert_allclose(problem.odometry.T_fixed_camera[2][:3, 3], [0.2, 0, 3])
    assert gathered.skipped == {"images without a transform at their time": 1}


def test_the_way_to_the_first_tag_counts():
    """So far the odometry has gone: what it was wrong by then, the map is."""
    gathered = MappingData()
    for number in range(4):
        gathered.add_frames(moving(number * 10**8, 0.1 * number), static=False)
        found = found_at(number * 10**8, 0.1 * number)
        gathered.add_found(found if number >= 2 else replace(found, detections=()))
    problem = gathered.problem(lambda _: SIZE, "map")
    assert problem.counts == (4, 1)
    assert [one.view for one in problem.sightings] == [2, 3]


def test_without_frames_images_of_several_tags_alone_tell_where_they_are():
    gathered = MappingData()
    gathered.add_found(found_at(0, 0.0, ("tag36h11_3", "tag36h11_4")))
    gathered.add_found(found_at(1, 0.1))
    problem = gathered.problem(lambda _: SIZE, "")
    assert problem.counts == (1, 2)
    assert gathered.skipped == {"images of a single tag, without tf": 1}


def test_tags_of_unknown_size_are_left_out_and_counted():
    gathered = MappingData()
    gathered.add_found(found_at(0, 0.0))
    assert not gathered.problem(lambda _: 0.0, "").sightings
    assert gathered.skipped["tags without a pose"] == 1


def test_images_of_two_cameras_are_views_of_their_rig_by_tf():
    """Those at one time are one view; else each has the pose of the rig at its own time."""
    gathered = MappingData([RigCamera("left"), RigCamera("right")])
    beside = TransformStamped("right", np.array([0.2, 0, 0]), [0, 0, 0, 1.0], Header(0, "camera"))
    gathered.add_frames(Transforms((beside,)), static=True)
    for number in range(6):
        gathered.add_frames(moving(number * 10**8, 0.1 * number), static=False)
    seen = {0: [0.0, 0.2, 0.4], 1: [0.0, 0.1, 0.4]}  # metres along the way, so in seconds
    for camera, places in seen.items():
        for x in places:
            found = found_at(round(x * 10**9), x + 0.2 * camera)
            frame_id = ("camera", "right")[camera]
            header = Header(found.header.stamp_ns, frame_id)
            gathered.add_found(replace(found, header=header), camera)
    problem = gathered.problem(lambda _: SIZE, "map")
    assert [(one.view, one.camera) for one in problem.sightings] == [
        *((0, 0), (0, 1), (1, 1), (2, 0), (3, 0), (3, 1))
    ]
    np.testing.assert_allclose(
        problem.odometry.T_fixed_camera[:, :3, 3],
        [[x, 0, 3] for x in (0, 0.1, 0.2, 0.4)],
        atol=1e-9,
    )
    right = problem.cameras[1]
    np.testing.assert_allclose(right.T_first_camera[:3, 3], [0.2, 0, 0])
    assert 0 < right.sigma_rad < 0.1
