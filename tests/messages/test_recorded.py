"""Messages as they stand in a recording, decoded on demand."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from through import HEADER, ROS1, ROS2, assert_same

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import (
    CameraInfo,
    CompressedImage,
    Header,
    Image,
    Imu,
    Text,
    Twist,
)
from ros_visualise.messages import to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType, content

IMU = Imu([0, 0, 0, 1], [1, 2, 3], [4, 5, 6], header=HEADER)
BOTH = pytest.mark.parametrize("types", [ROS1, ROS2], ids=["ros1", "ros2"])


def recorded(data, types, stamp_ns=77, cut=None, calibration=None):
    name = data.type_name
    raw = bytes(types.write(name, to_message(data, types.types)))
    return Recorded(name, raw[:cut], types, stamp_ns, calibration)


@BOTH
def test_the_content_is_decoded_once_and_the_header_before(types):
    one = recorded(IMU, types)
    assert one.header == HEADER
    assert_same(one.content, IMU)
    assert one.content is one.content
    assert content(one) is one.content
    assert content(IMU) is IMU


@BOTH
@pytest.mark.parametrize("data", [Text("a"), Twist([1, 2, 3], [4, 5, 6])])
def test_what_has_no_header_was_taken_when_it_was_recorded(types, data):
    one = recorded(data, types)
    assert one.header == one.content.header == Header(77)
    assert_same(one.content, replace(data, header=Header(77)))


@BOTH
def test_an_image_gets_its_calibration(types):
    image = Image(np.zeros((2, 3), np.float32), "32FC1", HEADER)
    info = CameraInfo(2, 3, np.eye(3), header=Header(5, "elsewhere"))
    found = recorded(image, types, calibration=recorded(info, types)).content
    assert (found.encoding, found.camera_info.header) == ("32FC1", HEADER)
    np.testing.assert_array_equal(found.camera_info.K, np.eye(3))


def test_compressed_depth_is_an_image():
    png = cv2.imencode(".png", np.full((2, 3), 1500, np.uint16))[1].tobytes()
    data = np.frombuffer(bytes(12) + png, np.uint8)
    found = recorded(CompressedImage(data, "16UC1; compressedDepth png", HEADER), ROS2).content
    assert (found.encoding, found.header) == ("16UC1", HEADER)
    assert (found.pixels == 1500).all()
    assert TopicType("sensor_msgs/msg/CompressedImage").data_class is Image


@BOTH
def test_damaged_messages_are_refused_in_one_line(types):
    cut = recorded(IMU, types, cut=40)
    with pytest.raises(DamagedMessage, match="cannot decode 40 bytes as sensor_msgs/msg/Imu"):
        _ = cut.content
    picture = recorded(CompressedImage(np.zeros(9, np.uint8), "jpeg", HEADER), types)
    with pytest.raises(DamagedMessage, match=r"CompressedImage: .* of 9 bytes is damaged"):
        _ = picture.content


@BOTH
@pytest.mark.parametrize("size", range(9))
def test_of_hardly_any_bytes_the_header_is_when_they_were_recorded(types, size):
    cut = recorded(IMU, types, cut=size)
    assert cut.header == Header(77)
    with pytest.raises(DamagedMessage, match=f"cannot decode {size} bytes as sensor_msgs/msg/Imu"):
        _ = cut.content


def test_a_type_with_fields_of_its_own_is_said_to_have_them():
    own = Definitions("cdr")
    own.define("nav_msgs/msg/Odometry", "float64 px\nfloat64 py")
    with pytest.raises(DamagedMessage, match="Odometry: differs from the standard definition"):
        _ = Recorded("nav_msgs/msg/Odometry", b"\0\1\0\0" + bytes(16), own, 5).content


def test_a_type_without_a_class_is_its_own_content():
    joy = Recorded("sensor_msgs/msg/Joy", b"", ROS1, 5)
    assert joy.content is joy
    assert joy.header == Header(5)
    assert TopicType("sensor_msgs/msg/Joy").data_class is Recorded
