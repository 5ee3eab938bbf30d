"""Cameras, homographies and ellipses of lessons, held against OpenCV and closed formulas."""

import cv2
import numpy as np
import pytest

from ros_visualise.data import Image
from ros_visualise.lessons.lesson import StepResult
from ros_visualise.lessons.methods.camera import calibrate, camera_matrix, distort, project
from ros_visualise.lessons.methods.homography import apply, ellipse, homography
from ros_visualise.lessons.topics import landmarks

K = camera_matrix(500, 640, 480)
D = np.array([-0.3, 0.08, 0.002, -0.001, 0.02])


@pytest.fixture
def points() -> np.ndarray:
    random = np.random.default_rng(0)
    return np.column_stack([random.uniform(-1, 1, (50, 2)), random.uniform(2, 9, 50)])


def test_a_pinhole_and_a_lens_project_as_opencv_does(points):
    none = np.zeros(3)
    theirs, _ = cv2.projectPoints(points, none, none, K, None)
    assert project(points, K) == pytest.approx(theirs[:, 0])
    theirs, _ = cv2.projectPoints(points, none, none, K, D)
    rays = distort(points[:, :2] / points[:, 2:], D)
    assert rays * [K[0, 0], K[1, 1]] + K[:2, 2] == pytest.approx(theirs[:, 0])


def test_calibration_finds_the_camera_within_what_it_says():
    truth = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *D])
    exact = calibrate(K, D, (640, 480), 12, 0, 1)
    assert exact.values == pytest.approx(truth, abs=2e-3, rel=1e-4)
    noisy = calibrate(K, D, (640, 480), 15, 0.3, 2)
    assert (np.abs(noisy.values - truth) < 4 * noisy.deviations).all()
    assert noisy.rms_px == pytest.approx(0.3 * np.sqrt(2), rel=0.1)  # of both coordinates


def test_a_homography_is_opencvs():
    random = np.random.default_rng(4)
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    for _ in range(10):
        corners = square * 100 + random.uniform(-20, 20, (4, 2))
        H = homography(square, corners)
        theirs = cv2.getPerspectiveTransform(*(a.astype(np.float32) for a in (square, corners)))
        assert pytest.approx(theirs, rel=1e-3, abs=1e-3) == H
        assert apply(H, square) == pytest.approx(corners)


def test_an_ellipse_lies_as_many_deviations_out():
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    for count in (1, 2):
        line = ellipse(covariance, count)
        out = np.einsum("ni,ij,nj->n", line, np.linalg.inv(covariance), line)
        assert out == pytest.approx(count**2)
    shares = [1 - np.exp(-(count**2) / 2) for count in (1, 2)]
    assert np.round(shares, 2).tolist() == [0.39, 0.86]  # what the lesson says


def test_a_tag_that_is_drawn_is_found_where_it_was_drawn():
    bgr = np.full((480, 640, 3), (60, 120, 90), np.uint8)
    image = StepResult(bgr, "bgr8", work=bgr)
    for tilt, turn, distance in ((0, 0, 1.0), (30, 20, 0.8), (-25, 40, 1.2)):
        params = landmarks.TagLessonParams(tilt=tilt, turn=turn, distance=distance)
        seen = landmarks.tag(image, params)["image"].work
        assert seen.name == "tag36h11_7"
        assert np.abs(seen.corners - seen.truth).max() < 0.1


def test_a_tag_of_ones_own_is_taken_and_none_is_said():
    bgr = np.full((480, 640, 3), 128, np.uint8)
    drawn = landmarks.tag(StepResult(bgr, "bgr8", work=bgr), landmarks.TagLessonParams(distance=1))
    own = drawn["image"].work.picture
    again = landmarks.tag(StepResult(own, "bgr8", work=own), landmarks.TagLessonParams(distance=50))
    assert again["image"].work.truth is None
    assert "found in your picture" in again["text"].text
    none = landmarks.tag(StepResult(bgr, "bgr8", work=bgr), landmarks.TagLessonParams(distance=50))
    assert "no tag" in none["text"].text
    for step in (landmarks.corners, landmarks.plane, landmarks.poses):
        answer = step(none["image"], landmarks.CornerParams())
        assert isinstance(answer["image"], Image)
        assert "No tag" in answer["text"].text
