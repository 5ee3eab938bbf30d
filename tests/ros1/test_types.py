"""Our data in genpy's messages, through their own serialization and back."""

import sys
from dataclasses import replace
from io import BytesIO
from typing import Any

import genpy
import numpy as np
import pytest
import rospy
from sample_messages import sample

from ros_visualise.core.errors import UsageError
from ros_visualise.core.message import topic_kinds
from ros_visualise.data import (
    CameraInfo,
    CompressedImage,
    Detection,
    Detection3D,
    Detections,
    Detections3D,
    DiagnosticArray,
    DiagnosticStatus,
    FluidPressure,
    Header,
    Hypothesis,
    Image,
    Imu,
    JointState,
    LaserScan,
    Level,
    MagneticField,
    Marker,
    MarkerArray,
    MarkerType,
    NavSatFix,
    Number,
    OccupancyGrid,
    Odometry,
    ParameterEvent,
    Path,
    PointCloud,
    PolygonStamped,
    PoseArray,
    PoseStamped,
    PoseWithCovarianceStamped,
    Range,
    Text,
    TimeReference,
    Transforms,
    TransformStamped,
    Twist,
    TwistStamped,
    TwistWithCovarianceStamped,
    VisionInfo,
)
from ros_visualise.messages import from_message, to_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.numeric_fields import numeric_fields
from ros_visualise.runtime.ros1.messages import TYPES, message_class

ROSBAGS = Definitions("ros1")
HEADER = Header(1_700_000_000_987_654_321, "cam00_optical")


def numbers(*shape: int) -> Any:
    return np.random.default_rng(3).normal(size=shape)


POINTS = np.arange(60, dtype=np.uint8).view([("x", ">f4"), ("rgb", ">u4"), ("n", "u1", (2,))])
POINTS = POINTS.reshape(2, 3)
IMAGE = Image(np.arange(30, dtype=np.uint16).reshape(2, 5, 3), "bgr16", HEADER)
DATA = [
    IMAGE,
    replace(IMAGE, header=Header()),
    CompressedImage(np.arange(9, dtype=np.uint8), "png", HEADER),
    PoseStamped(numbers(3), numbers(4), HEADER),
    Odometry(
        numbers(3),
        numbers(4),
        numbers(3),
        numbers(3),
        numbers(6, 6),
        numbers(6, 6),
        "base_link",
        HEADER,
    ),
    Path(np.array([0, 10**18]), numbers(2, 3), numbers(2, 4), HEADER),
    CameraInfo(375, 1242, numbers(3, 3), numbers(5), numbers(3, 3), numbers(3, 4), header=HEADER),
    replace(CameraInfo.uncalibrated(480, 640), header=HEADER),
    DiagnosticArray(
        (DiagnosticStatus("/filters", Level.WARN, "dropped 1", {"hz": "9.7", "é": ""}),), HEADER
    ),
    FluidPressure(101325.25, np.nan, HEADER),
    Imu(numbers(4), numbers(3), numbers(3), -np.ones((3, 3)), header=HEADER),
    JointState(("left", "right"), numbers(2), efforts=numbers(2), header=HEADER),
    LaserScan(
        np.array([1.5, np.inf, np.nan], np.float32), -1.0, 1.0, 1.0, 0.125, 30.0, header=HEADER
    ),
    MagneticField(numbers(3), numbers(3, 3), HEADER),
    NavSatFix(49.01, 8.42, np.nan, numbers(3, 3), 3, -1, 15, HEADER),
    PointCloud(POINTS, False, HEADER),
    PointCloud(POINTS[:0, 0], True, HEADER),
    OccupancyGrid(
        np.array([[0, 100, -1], [50, 1, -128]], np.int8),
        0.25,
        numbers(3),
        numbers(4),
        10**18,
        HEADER,
    ),
    PolygonStamped(numbers(4, 3), HEADER),
    PoseArray(numbers(2, 3), numbers(2, 4), HEADER),
    PoseWithCovarianceStamped(numbers(3), numbers(4), numbers(6, 6), HEADER),
    Text("ä text"),
    Number(2.5),
    TimeReference(1_700_000_000_123_456_789, "start of the scan", HEADER),
    TransformStamped("lidar", numbers(3), numbers(4), HEADER),
    Twist(numbers(3), numbers(3)),
    TwistStamped(numbers(3), numbers(3), HEADER),
    TwistWithCovarianceStamped(numbers(3), numbers(3), numbers(6, 6), HEADER),
    Range(1.5, 0.125, 12.0, 0.03125, 1, 0.0, HEADER),
    Marker(
        MarkerType.LINE_LIST,
        numbers(3),
        numbers(4),
        points_xyz=numbers(4, 3),
        colors_rgba=numbers(4, 4),
        lifetime_ns=1_500_000_000,
        header=HEADER,
    ),
]
TRANSFORMS = Transforms((TransformStamped("lidar", numbers(3), numbers(4), HEADER),) * 2)


def serialize(message: Any) -> bytes:
    pixels = getattr(message, "data", None)
    if isinstance(pixels, np.ndarray) and pixels.dtype == np.uint8:
        message.data = pixels.tobytes()  # as rospy itself takes it
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize("data", DATA, ids=lambda data: type(data).__name__)
def test_data_survives(data: Any) -> None:
    kind = message_class(data.type_name)
    raw = serialize(to_message(data, TYPES))
    found = from_message(kind().deserialize(raw), type(data))
    for name, value in vars(data).items():
        np.testing.assert_array_equal(getattr(found, name), value, err_msg=name)


@pytest.mark.parametrize("data", DATA, ids=lambda data: type(data).__name__)
def test_genpy_and_rosbags_write_the_same_bytes(data: Any) -> None:
    ours = ROSBAGS.write(data.type_name, to_message(data, ROSBAGS.types))
    assert serialize(to_message(data, TYPES)) == bytes(ours)


@pytest.mark.parametrize("data", DATA, ids=lambda data: type(data).__name__)
def test_genpy_and_rosbags_show_the_same_numbers(data: Any) -> None:
    raw = serialize(to_message(data, TYPES))
    sent = message_class(data.type_name)().deserialize(raw)
    np.testing.assert_equal(numeric_fields(sent), numeric_fields(ROSBAGS.read(data.type_name, raw)))


def test_several_transforms_survive() -> None:
    raw = serialize(to_message(TRANSFORMS, TYPES))
    assert raw == bytes(
        ROSBAGS.write("tf2_msgs/msg/TFMessage", to_message(TRANSFORMS, ROSBAGS.types))
    )
    found = from_message(message_class(Transforms.type_name)().deserialize(raw), Transforms)
    for one, other in zip(found.transforms, TRANSFORMS.transforms, strict=True):
        assert (one.child_frame_id, one.header) == (other.child_frame_id, other.header)
        np.testing.assert_array_equal(one.translation_xyz, other.translation_xyz)
        np.testing.assert_array_equal(one.quat_xyzw, other.quat_xyzw)


def test_every_message_is_of_the_class_that_its_topic_has() -> None:
    markers = MarkerArray((Marker(MarkerType.CUBE, header=HEADER),))
    found = Detections((Detection(numbers(2), numbers(2), 0.5, (Hypothesis("3", 0.5),)),), HEADER)
    around = Detections3D((Detection3D(numbers(3), numbers(4), numbers(3)),), HEADER)
    about = VisionInfo("detector", "/names", 1, HEADER)
    data_of_all = [*DATA, TRANSFORMS, markers, found, around, about]
    for data in data_of_all:
        message = to_message(data, TYPES)
        assert type(message) is message_class(data.type_name)
        assert serialize(message) == bytes(
            ROSBAGS.write(data.type_name, to_message(data, ROSBAGS.types))
        )
    named = {type(data) for data in data_of_all}
    for kind in set(topic_kinds()) - named - {ParameterEvent}:
        data = sample(kind)
        raw = serialize(to_message(data, TYPES))
        found = from_message(message_class(kind.type_name)().deserialize(raw), kind)
        for name, value in vars(data).items():
            np.testing.assert_array_equal(getattr(found, name), value, err_msg=name)


def test_a_type_whose_package_is_not_installed_is_made_from_its_definition(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "visualization_msgs", None)
    monkeypatch.setitem(sys.modules, "visualization_msgs.msg", None)
    made = type(TYPES)(TYPES)
    made.pop("visualization_msgs/msg/MarkerArray", None)
    kind = made["visualization_msgs/msg/MarkerArray"]
    assert kind._type == "visualization_msgs/MarkerArray"
    assert kind._md5sum == "d155b9ce5188fbaf89745847fd5882d7"


def test_detections_have_the_official_type_though_nobody_installed_it() -> None:
    assert message_class(Detections.type_name)._md5sum == "402071f61477de256df9f1aa45e6e4c8"
    assert message_class(Detections3D.type_name)._md5sum == "05c51d9aea1fb4cfdc8effb94f197b6f"


def test_what_ros_1_lacks_is_refused() -> None:
    with pytest.raises(UsageError, match="no messages of type rcl_interfaces"):
        message_class(ParameterEvent.type_name)


def test_pixels_are_not_copied_either_way() -> None:
    message = to_message(IMAGE, TYPES)
    assert np.shares_memory(message.data, IMAGE.pixels)
    assert np.shares_memory(from_message(message, Image).pixels, IMAGE.pixels)
    message.data = bytes(message.data)
    np.testing.assert_array_equal(from_message(message, Image).pixels, IMAGE.pixels)


@pytest.mark.parametrize("time", [genpy.Time, rospy.Time])
def test_either_class_of_times_fits(time: Any) -> None:
    types = {**TYPES, "builtin_interfaces/msg/Time": time}
    message = to_message(IMAGE, types)
    assert type(message.header.stamp) is time
    assert message.header.stamp == genpy.Time(1_700_000_000, 987_654_321)
    assert from_message(message, Image).header == HEADER
