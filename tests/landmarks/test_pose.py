"""Poses of tags and of bodies with several tags, against the truth that made the pixels."""

import cv2
import numpy as np
import pytest

from ros_visualise.core.errors import UncalibratedCamera
from ros_visualise.data import CameraInfo
from ros_visualise.geometry import rotations, se3
from ros_visualise.landmarks.pose import rig_poses, square_poses, squares_poses
from ros_visualise.landmarks.pose.refinement import turn
from ros_visualise.vision.projection import project

K = np.array([[600.0, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
MODELS = {
    "plumb_bob": [-0.28, 0.09, 0.0007, -0.0004, -0.01],
    "rational_polynomial": [0.5, -0.2, 0.0005, 0.001, 0.02, 0.7, -0.1, 0.01],
    "equidistant": [0.02, -0.01, 0.003, -0.001],
}
SIZE = 0.2
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIZE / 2
FACING = np.diag([1.0, -1, -1])
"""R of a tag that looks straight at the camera, its upper edge up."""


def camera(model="plumb_bob", D=(0, 0, 0, 0, 0)):
    return CameraInfo(480, 640, K, np.array(D, float), distortion_model=model)


def seen(R, t, info, points=SQUARE):
    pixels, in_front = project(points @ R.T + t, info)
    assert in_front.all()
    return pixels


def tilted(degrees, about=0.0):
    axis = np.array([np.cos(about), np.sin(about), 0])
    return turn(axis * np.deg2rad(degrees)) @ FACING


def error_of(found, R, t):
    """What takes the pose found to the truth: a shift and a turn about fixed axes, (6,)."""
    rest = R @ rotations.to_matrix(found.quat_xyzw).T
    return np.concatenate([t - found.position_xyz, cv2.Rodrigues(rest)[0].ravel()])


@pytest.mark.parametrize("model", MODELS)
def test_what_was_projected_is_found_where_it_was(model):
    info, rng = camera(model, MODELS[model]), np.random.default_rng(1)
    for _ in range(30):
        R = tilted(rng.uniform(10, 70), rng.uniform(0, 6.28)) @ turn([0, 0, rng.uniform(0, 6.28)])
        t = np.array([rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), 1]) * rng.uniform(0.8, 3)
        best = square_poses(seen(R, t, info), SIZE, info)[0]
        assert np.abs(error_of(best, R, t)).max() < 1e-5
        assert best.rms_px < 1e-4


def test_the_axes_of_a_tag_are_right_up_and_out():
    corners = [[300.0, 260], [340, 260], [340, 220], [300, 220]]  # lower left first, v down
    best = square_poses(corners, SIZE, camera())[0]
    tag_in_camera = rotations.to_matrix(best.quat_xyzw)
    assert np.allclose(tag_in_camera, FACING, atol=0.01)
    assert np.allclose(best.position_xyz, [0.5 / 600 * 3, 0.5 / 600 * 3, 3], atol=1e-3)


def test_a_camera_without_calibration_is_told():
    with pytest.raises(UncalibratedCamera, match="not calibrated"):
        square_poses(SQUARE[:, :2] * 100, SIZE, CameraInfo.uncalibrated(480, 640))


@pytest.mark.parametrize(
    "corners",
    [
        [[1.0, 1], [2, 2], [3, 3], [4, 4]],
        [[1.0, 1], [1, 1], [1, 1], [1, 1]],
        [[np.nan, 1], [9, 1], [9, 9], [1, 9]],
        [[np.inf, 1], [9, 1], [9, 9], [1, 9]],
        [[1e300, 1], [9, 1], [9, 9], [1, 9]],
    ],
)
@pytest.mark.parametrize("model", MODELS)
def test_corners_that_are_no_square_have_no_pose(corners, model):
    assert square_poses(corners, SIZE, camera(model, MODELS[model])) == ()


def test_many_tags_at_once_are_as_each_alone():
    info = camera("plumb_bob", MODELS["plumb_bob"])
    corners = [seen(tilted(a), np.array([0.1, 0, 2 + a / 50]), info) for a in (5, 20, 50)]
    corners.insert(1, np.full((4, 2), np.nan))
    together = squares_poses(corners, [SIZE] * 4, info)
    assert [len(one) for one in together] == [len(square_poses(c, SIZE, info)) for c in corners]
    for several, c in zip(together, corners, strict=True):
        for one, alone in zip(several, square_poses(c, SIZE, info), strict=True):
            assert np.allclose(one.position_xyz, alone.position_xyz, atol=1e-6)


def test_a_body_of_several_tags_is_surer_than_one_tag():
    info, R, t = camera(), tilted(20), np.array([0.1, -0.05, 6.0])
    body = np.concatenate([SQUARE + np.array([x, y, 0]) for x in (0, 0.3) for y in (0, 0.3)])
    whole = rig_poses(seen(R, t, info, body), body, info, 0.2)
    single = square_poses(seen(R, t, info), SIZE, info, 0.2)
    assert np.abs(error_of(whole[0], R, t)).max() < 1e-5
    assert (np.diag(whole[0].covariance) < np.diag(single[0].covariance)).all()
    assert len(whole) == 1
    assert len(single) == 2


def test_a_body_that_is_not_flat_has_one_pose():
    info, R, t = camera(), tilted(30, 1.0), np.array([0.1, -0.05, 2.0])
    body = np.concatenate([SQUARE, SQUARE @ turn([0, 1.2, 0]).T + [0.2, 0, -0.1]])
    found = rig_poses(seen(R, t, info, body), body, info, 0.2)
    assert len(found) == 1
    assert np.abs(error_of(found[0], R, t)).max() < 1e-5


def test_a_pose_puts_the_tag_where_transforms_say():
    info, R, t = camera(), tilted(40), np.array([0.2, 0.1, 1.5])
    best = square_poses(seen(R, t, info), SIZE, info)[0]
    T = se3.from_pose(best.position_xyz, best.quat_xyzw)
    assert np.allclose(project(se3.apply(T, SQUARE), info)[0], seen(R, t, info), atol=1e-3)
