"""Tags that move in the images of a rolling shutter."""

import camera_pictures
import numpy as np
import pytest

from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.landmarks.tags import Tag
from ros_visualise.landmarks.tags.shutter import RollingShutter
from ros_visualise.nodes.tag_detector import TagDetector, TagParams

CAMERA = camera_pictures.CAMERAS["rolling shutter, 20 ms, 300 px/s"]


@pytest.fixture(scope="module")
def sights():
    return list(camera_pictures.sights(CAMERA, 8, seed=7))


def seen(sights, readout):
    """Largest error of each tag, and its squared error in standard deviations."""
    size = camera_pictures.HEIGHT, camera_pictures.WIDTH
    info = CameraInfo(*size, CAMERA.matrix, np.array(CAMERA.D))
    params = TagParams(size=camera_pictures.SIZE_M, readout=readout, corner_floor=0.0)
    node, errors = TagDetector(params), []
    for number, sight in enumerate(sights):
        image = Image(sight.gray, "mono8", Header((number + 1) * 10**8, "camera"), info)
        (tag,) = node.step(image, params)["detections"].detections
        error = (tag.corners_uv - sight.corners_uv).ravel()
        value = error @ np.linalg.solve(tag.corners_covariance, error)
        errors.append((np.abs(error).max(), value))
    return np.array(errors)


@pytest.fixture(scope="module")
def unknown(sights):
    """Errors where the readout time is unknown."""
    return seen(sights, -1.0)


def test_a_known_readout_time_moves_the_corners_back(sights, unknown):
    known = seen(sights, CAMERA.readout_s)
    is_first = np.arange(len(sights)) % 4 == 0
    assert np.median(known[~is_first, 0]) < 0.2 * np.median(unknown[~is_first, 0])
    # 95% of chi squared of 8 numbers are below 15.5, and 99.4% of shares of 24 above 0.8
    assert (known[~is_first, 1] < 15.5).mean() > 0.8


def test_covariance_grows_with_motion_where_the_readout_time_is_unknown(sights, unknown):
    is_first = np.arange(len(sights)) % 4 == 0
    assert (unknown[~is_first, 1] < 15.5).mean() > 0.8
    assert np.median(seen(sights, 0.0)[~is_first, 1]) > 50, "a global shutter"


def test_tags_of_one_image_know_no_more_of_the_readout_time_together():
    """An error that they share stays when they are averaged; cameras take up to 30 ms."""
    shutter = RollingShutter()
    square = np.array([[0.0, 40], [40, 40], [40, 0], [0, 0]])
    for number in range(2):
        places = [square + np.array([50 + 80 * n, 300 + 30 * number]) for n in range(5)]
        tags = [Tag("tag36h11", n, uv, 0, 50, 1e-4 * np.eye(8)) for n, uv in enumerate(places)]
        seen = shutter.at_stamp(tags, (number + 1) * 10**8, 480, -1.0)
    information = 0.0
    for before, after in zip(tags, seen, strict=True):
        rows = (before.corners_uv[:, 1:] + 0.5) / 480 - 0.5
        shift = (rows * [0, 300]).ravel()
        information += shift @ np.linalg.solve(after.covariance_px2, shift)
    assert information < 1.01 / 0.01**2
