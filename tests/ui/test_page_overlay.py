"""Points of a cloud over the picture of an image."""

import numpy as np
import pytest
from scene_messages import K, cloud, image, tf, transform

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import CameraInfo
from ros_visualise.ui.live.overlay import between, choose_calibration, is_rectified, paint, scaled
from ros_visualise.ui.scene.frames import Frames

INFO = CameraInfo(120, 160, K)
GRAY = np.full((120, 160, 3), 90, np.uint8)
SPOT = [[1.025, -0.475, 5.0]]  # at u = 79.5 + 20.5, v = 59.5 - 9.5


def changed(picture, shown=GRAY):
    """Rows and columns of the pixels that are not as before."""
    return np.argwhere((picture != shown).any(axis=2)).tolist()


def test_a_point_is_painted_where_the_camera_sees_it():
    assert changed(paint(GRAY, cloud(SPOT), np.eye(4), INFO, False)) == [[50, 100]]
    assert (GRAY == 90).all()


def test_of_a_scaled_picture_too():
    half = GRAY[::2, ::2]
    assert changed(paint(half, cloud(SPOT), np.eye(4), INFO, False), half) == [[25, 50]]


def test_pixels_scale_about_the_corner_of_the_image():
    assert scaled(np.array([[-0.4, 0.4], [159.4, 119.4]]), INFO, (60, 80)).tolist() == [
        [0, 0],
        [79, 59],
    ]
    assert (scaled(np.array([[-0.6, 1e30]]), INFO, (60, 80)) == [-1, 500_000]).all()


def test_what_is_behind_aside_or_no_number_is_not_painted():
    aside = [[1.0, 0, -5], [50, 0, 5], [0, -50, 5], [np.nan, 0, 1]]
    assert changed(paint(GRAY, cloud(aside), np.eye(4), INFO, False)) == []


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearer_point_covers_the_farther(order):
    line = [[0.205, -0.095, 1.0], [2.05, -0.95, 10.0]]
    both = paint(GRAY, cloud(line[::order]), np.eye(4), INFO, False)
    near = paint(GRAY, cloud(line[:1]), np.eye(4), INFO, False)
    assert np.array_equal(both, near)
    assert not np.array_equal(near, paint(GRAY, cloud(line[1:]), np.eye(4), INFO, False))


def test_a_cloud_is_seen_from_where_the_camera_was_at_the_images_time():
    frames = Frames()
    frames.add(
        tf(transform("base_link", "camera", [0, 0, 1]), transform("base_link", "lidar", [1, 0, 0])),
        True,
    )
    frames.add(tf(*(transform("odom", "base_link", [x, 0, 0], x) for x in range(5))), False)
    T = between(frames, image(stamp_s=3.0), cloud(SPOT, stamp_s=2.5))
    assert np.allclose(T[:3, 3], [1 + 2.5 - 3.0, 0, -1])
    assert np.allclose(T[:3, :3], np.eye(3))
    with pytest.raises(NoTransform):
        between(frames, image("nowhere"), cloud(SPOT))


def test_a_calibration_has_to_be_of_the_image():
    assert choose_calibration(image(), None).K is K
    bare = image(calibrated=False)
    assert choose_calibration(bare, INFO) is INFO
    assert choose_calibration(bare, None) is None
    assert choose_calibration(bare, CameraInfo(480, 640, K)) is None
    assert choose_calibration(bare, CameraInfo.uncalibrated(120, 160)) is None


P = np.hstack([K, [[-40.0], [0], [0]]])
PLAIN = CameraInfo(120, 160, K, P=P)
DISTORTED = CameraInfo(120, 160, K, np.array([0.1, 0, 0, 0, 0]), P=P)


@pytest.mark.parametrize(
    "topic", ["image_rect", "/left/image_rect_color", "/cam/image_rect/compressed"]
)
def test_images_are_rectified_that_are_called_as_image_proc_calls_them(topic):
    assert is_rectified(topic, DISTORTED)


@pytest.mark.parametrize("topic", ["/image_raw", "/direct/image", "/rectangles", "/edges"])
def test_other_images_are_rectified_where_that_would_change_nothing(topic):
    assert is_rectified(topic, PLAIN)
    assert not is_rectified(topic, DISTORTED)
    assert not is_rectified(topic, CameraInfo(120, 160, K, P=P * [[2], [2], [1]]))
    turned = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert not is_rectified(topic, CameraInfo(120, 160, K, R=turned, P=P))
    assert not is_rectified(topic, CameraInfo(120, 160, K))


def test_of_a_rectified_image_the_projection_holds():
    shifted = [[1.025 + 40 * 5 / 100 / 5, -0.475, 5.0]]  # P's last column takes 0.4 m off
    assert changed(paint(GRAY, cloud(shifted), np.eye(4), PLAIN, True)) == [[50, 100]]
