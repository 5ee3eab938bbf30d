"""Points in pixels, against OpenCV and by the definitions."""

import cv2
import numpy as np
import pytest

from ros_visualise.data import CameraInfo
from ros_visualise.vision.projection import project

K = np.array([[530.0, 0, 321.5], [0, 528.0, 238.2], [0, 0, 1]])
PLUMB_BOB = np.array([-0.28, 0.09, 0.0007, -0.0004, -0.01])
NONE = np.zeros(3)


@pytest.fixture
def points():
    rng = np.random.default_rng(3)
    z = rng.uniform(1, 60, 500)
    return np.stack([rng.uniform(-0.5, 0.5, 500) * z, rng.uniform(-0.4, 0.4, 500) * z, z], axis=1)


def camera(D=(), model="plumb_bob", **rest):
    return CameraInfo(480, 640, K, np.array(D, float), distortion_model=model, **rest)


@pytest.mark.parametrize("D", [np.zeros(5), PLUMB_BOB])
def test_a_pinhole_projects_as_opencv_does(points, D):
    pixels, in_front = project(points.astype(np.float32), camera(D))
    expected, _ = cv2.projectPoints(points, NONE, NONE, K, D)
    assert in_front.all()
    assert np.abs(pixels - expected[:, 0]).max() < 1e-3


@pytest.mark.parametrize("D", [np.zeros(4), np.array([0.02, -0.01, 0.003, -0.001])])
def test_a_fisheye_projects_as_opencv_does(points, D):
    pixels, _ = project(points, camera(D, "equidistant"))
    expected, _ = cv2.fisheye.projectPoints(points[:, None], NONE, NONE, K, D)
    assert np.abs(pixels - expected[:, 0]).max() < 1e-6


def test_a_rectified_image_has_its_own_matrix_and_the_second_camera_its_baseline():
    P = np.array([[700.0, 0, 300, -70], [0, 710, 200, 0], [0, 0, 1, 0]])
    info = camera(PLUMB_BOB, P=P, R=np.diag([-1.0, -1.0, 1.0]))
    pixels, _ = project(np.array([[1.0, 0.5, 10.0]]), info, rectified=True)
    assert np.allclose(pixels, [[300 + 700 * (1.0 - 0.1) / 10, 200 + 710 * 0.05]])


def test_a_raw_image_is_turned_back_from_the_rectified_frame():
    turned = cv2.Rodrigues(np.array([0.01, -0.02, 0.03]))[0]
    ray = np.array([[0.1, -0.2, 2.0]])
    pixels, _ = project(ray @ turned.T, camera(PLUMB_BOB, R=turned))
    assert np.allclose(pixels, project(ray, camera(PLUMB_BOB))[0])


def test_what_is_behind_or_no_number_is_not_in_front():
    points = np.array([[0, 0, 2.0], [0, 0, -2.0], [0, 0, 0], [np.nan, 0, 1.0], [0, 0, np.inf]])
    pixels, in_front = project(points, camera(PLUMB_BOB))
    assert in_front.tolist() == [True, False, False, False, False]
    assert np.allclose(pixels[0], K[:2, 2])
    assert not pixels[1:].any()


def test_what_distortion_would_fold_back_into_the_image_is_left_out():
    far_aside = np.array([[2.0, 0.0, 1.0]])  # 63 degrees off the axis of a camera that sees 31
    folded, _ = cv2.projectPoints(far_aside, NONE, NONE, K, np.array([-0.3, 0, 0, 0]))
    assert 0 < folded.ravel()[0] < 640
    _, in_front = project(far_aside, camera([-0.3, 0, 0, 0]))
    assert not in_front.any()


def test_nothing_projects_to_nothing():
    pixels, in_front = project(np.zeros((0, 3)), camera(PLUMB_BOB))
    assert pixels.shape == (0, 2)
    assert in_front.shape == (0,)


def test_a_camera_without_calibration_or_of_an_unknown_model_is_refused():
    with pytest.raises(ValueError, match="not calibrated"):
        project(np.ones((1, 3)), CameraInfo.uncalibrated(480, 640))
    with pytest.raises(ValueError, match="'thin_prism'"):
        project(np.ones((1, 3)), camera(model="thin_prism"))
