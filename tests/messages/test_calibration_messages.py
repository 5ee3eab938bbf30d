"""Where the calibration of an image is, by what ROS calls it."""

from dataclasses import replace

import numpy as np
import pytest

from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.messages.calibrations import (
    CAMERA_INFO,
    calibration_of,
    calibration_topic,
    info_topic,
)
from ros_visualise.messages.recorded import TopicType

RAW = TopicType("sensor_msgs/msg/Image")
COMPRESSED = TopicType("sensor_msgs/msg/CompressedImage")


@pytest.mark.parametrize(
    ("image", "info"),
    [
        ("/image_raw", "/camera_info"),
        ("/left/image_color", "/left/camera_info"),
        ("/left/image_rect", "/left/image_rect/camera_info"),
        ("/edges", "/edges/camera_info"),
        ("/drone/processed_image", "/drone/processed_image/camera_info"),
    ],
)
def test_it_is_published_where_ros_expects_it(image, info):
    assert info_topic(image) == info


@pytest.mark.parametrize(
    ("image", "kind", "infos", "found"),
    [
        ("/a/left", RAW, ["/a/camera_info", "/a/left/camera_info"], "/a/left/camera_info"),
        ("/a/left", RAW, ["/a/camera_info", "/camera_info"], "/a/camera_info"),
        ("/a/image_raw", RAW, ["/a/image_raw/camera_info", "/b/camera_info"], None),
        (
            "/edges/compressed",
            COMPRESSED,
            ["/camera_info", "/edges/camera_info"],
            "/edges/camera_info",
        ),
        ("/a/image_raw/compressed", COMPRESSED, ["/a/camera_info"], "/a/camera_info"),
        ("/a/image_rect", RAW, ["/a/camera_info"], "/a/camera_info"),
        ("/a/points", TopicType("sensor_msgs/msg/PointCloud2"), ["/a/camera_info"], None),
    ],
)
def test_of_those_that_there_are_it_is_the_images_own_else_its_namespaces(
    image, kind, infos, found
):
    known = {image: kind, **dict.fromkeys(infos, CAMERA_INFO)}
    assert calibration_topic(image, known) == found
    assert calibration_topic(image, {image: kind, **dict.fromkeys(infos, RAW)}) is None


def test_it_has_the_images_header_and_none_that_says_nothing_counts():
    image = Image(np.zeros((2, 3), np.uint8), "mono8", Header(7, "cam"))
    info = CameraInfo(2, 3, np.diag([5.0, 6.0, 1.0]), header=Header(1, "other"))
    found = calibration_of(replace(image, camera_info=info))
    assert (found.header, found.K[0, 0]) == (Header(7, "cam"), 5.0)
    assert calibration_of(image) is None
    assert calibration_of(replace(image, camera_info=CameraInfo.uncalibrated(2, 3))) is None
