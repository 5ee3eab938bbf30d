"""Calibration files: read as ROS writes them, fitted to the images, or refused in one line."""

import logging
import os

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.data import Image
from ros_visualise.sources.calibration import Calibration, read_calibration

OST = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [535.92, 0.00000, 342.28, 0.00000, 535.5, 235.57, 0.00000, 0.00000, 1.00000]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.26637, -3.859e-02, 0.00178, -2.8e-4, 0.238392]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 0, -1, 0, 1, 0]
projection_matrix:
  rows: 3
  cols: 4
  data: [500, 0, 340, -25.5, 0, 501, 236, 0, 0, 0, 1, 0]
"""


@pytest.fixture
def write(tmp_path):
    def write(text, name="ost.yaml"):
        path = tmp_path / name
        path.write_text(text)
        return str(path)

    return write


def images(*size):
    return Image(np.zeros(size[::-1], np.uint8), "mono8")


def test_a_file_of_cameracalibrator_is_read(write):
    info = read_calibration(write(OST))
    assert (info.width, info.height, info.distortion_model) == (640, 480, "plumb_bob")
    np.testing.assert_array_equal(info.K, [[535.92, 0, 342.28], [0, 535.5, 235.57], [0, 0, 1]])
    np.testing.assert_array_equal(info.D, [-0.26637, -0.03859, 0.00178, -0.00028, 0.238392])
    np.testing.assert_array_equal(info.R, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_array_equal(info.P, [[500, 0, 340, -25.5], [0, 501, 236, 0], [0, 0, 1, 0]])


def test_other_models_of_distortion_keep_their_coefficients(write):
    fisheye = OST.replace("plumb_bob", "equidistant").replace(", 0.238392]", "]")
    info = read_calibration(write(fisheye))
    assert (info.distortion_model, len(info.D)) == ("equidistant", 4)


@pytest.mark.parametrize("prefix", ["", "file://", "file://localhost"])
def test_a_path_may_be_a_url(write, prefix):
    path = write(OST, "my camera.yaml")
    url = prefix + (path.replace(" ", "%20") if prefix else path)
    assert read_calibration(url).width == 640


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("missing.yaml", r"missing\.yaml: no such file.*; give a calibration file"),
        (".", r"\.: Is a directory"),
        ("package://mine/cam.yaml", "package:// needs ROS; give the file's path"),
        ("http://host/cam.yaml", r"http://host/cam.yaml: give a path or file:///PATH"),
        ("file://host/cam.yaml", r"file://host/cam.yaml: give a path or file:///PATH"),
    ],
)
def test_an_address_without_a_file_is_refused(url, expected):
    with pytest.raises(OpenError, match=expected):
        read_calibration(url)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("image_width: [640", "not YAML: .*; give a calibration"),
        ("", "no camera calibration"),
        ("- 1\n- 2\n", "no camera calibration"),
        ("path: video.mp4\n", "no camera calibration: it has no camera_matrix with data"),
        (OST.replace("image_width: 640", "image_width: wide"), "its image_width is wide"),
        (OST.replace("image_height: 480", "image_height: 0"), "its image_height is 0"),
        (OST.replace("640", "1000000000000"), "its image_width is 1000000000000"),
        (OST.replace("480", "65537"), "its image_height is 65537"),
        (OST.replace("480", "true"), "its image_height is True"),
        (OST.replace("[500, 0,", "[500,"), "its projection_matrix has 11 numbers, not 12"),
        (OST.replace("535.92", "0"), "its camera_matrix has no focal lengths"),
        (OST.replace("535.92", ".nan"), "its camera_matrix holds a value that is not a number"),
        (OST.replace("[1, 0, 0, 0", "[[1], 0, 0, 0"), "rectification_matrix holds a value"),
        (
            OST.replace("-0.26637", "much"),
            "distortion_coefficients holds a value that is not a number",
        ),
        (OST.replace("rectification_matrix", "R"), "it has no rectification_matrix with data"),
    ],
)
def test_a_file_of_something_else_is_refused_in_one_line(write, text, expected):
    with pytest.raises(OpenError, match=expected) as caught:
        read_calibration(write(text))
    assert str(caught.value).startswith(str(write(text)))
    assert "\n" not in str(caught.value)


def test_bytes_are_no_yaml(tmp_path):
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(OpenError, match=r"photo\.jpg: not YAML"):
        read_calibration(str(tmp_path / "photo.jpg"))


def test_a_file_of_opencv_is_refused(recordings):
    with pytest.raises(OpenError, match=r"left_intrinsics\.yml: not YAML"):
        read_calibration(str(recordings / "calib" / "opencv" / "left_intrinsics.yml"))


def test_images_of_its_size_get_it_as_it_is(write):
    path = write(OST)
    info = Calibration(path).add_to(images(640, 480)).camera_info
    np.testing.assert_array_equal(info.K, read_calibration(path).K)


@pytest.mark.parametrize("size", [(320, 240), (1280, 960), (100, 75), (101, 75), (853, 640)])
def test_images_that_are_scaled_get_it_scaled(write, size):
    """The corners of the image stay the corners: pixel centres are whole numbers."""
    path = write(OST)
    before, after = read_calibration(path), Calibration(path).add_to(images(*size)).camera_info
    assert (after.width, after.height) == size
    corner = np.array([-0.5, -0.5, 1])
    np.testing.assert_allclose(
        np.linalg.solve(after.K, corner), np.linalg.solve(before.K, corner), atol=1e-12
    )
    far = [np.array([i.width - 0.5, i.height - 0.5, 1]) for i in (before, after)]
    np.testing.assert_allclose(
        np.linalg.solve(after.K, far[1]), np.linalg.solve(before.K, far[0]), atol=1e-12
    )


@pytest.mark.parametrize("size", [(640, 360), (480, 640), (640, 490), (1920, 1080)])
def test_images_of_another_shape_are_refused_or_go_without(write, size, caplog):
    calibration = Calibration(write(OST))
    with pytest.raises(OpenError, match="made for images of 640x480; images of"):
        calibration.fit(size)
    with caplog.at_level(logging.ERROR):
        found = [calibration.add_to(images(*size)).camera_info for _ in range(3)]
    assert found == [None] * 3
    assert len(caplog.records) == 1
    assert "publishing images without a calibration" in caplog.text


def test_no_file_is_no_calibration():
    image = images(64, 48)
    assert Calibration("").add_to(image) is image
    assert Calibration("").fit((64, 48)) is None


def test_a_file_that_comes_to_be_or_changes_is_followed(write, tmp_path, caplog):
    path = tmp_path / "later.yaml"
    with caplog.at_level(logging.INFO):
        calibration = Calibration(str(path))
    assert "no such file; publishing images without a calibration" in caplog.text
    image = images(640, 480)
    assert calibration.add_to(image) is image
    write(OST, "later.yaml")
    assert calibration.add_to(image).camera_info.K[0, 0] == 535.92
    os.replace(write(OST.replace("535.92", "536.5"), "new.yaml"), path)
    assert calibration.add_to(image).camera_info.K[0, 0] == 536.5


def test_a_file_that_is_damaged_or_goes_changes_nothing(write, caplog):
    path = write(OST)
    calibration = Calibration(path)
    os.replace(write("image_width: [", "new.yaml"), path)
    found = [calibration.add_to(images(640, 480)).camera_info for _ in range(3)]
    os.unlink(path)
    found.append(calibration.add_to(images(640, 480)).camera_info)
    assert [info.K[0, 0] for info in found] == [535.92] * 4
    assert caplog.text.count("keeping the previous calibration") == 1
