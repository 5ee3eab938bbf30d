"""Our data in genpy's messages, through their own serialization and back."""

from dataclasses import replace
from io import BytesIO
from typing import Any

import genpy
import numpy as np
import pytest
import rospy
from rosbags.typesys import Stores, get_typestore

from ros_visualise.data import (
    MESSAGES,
    CameraInfo,
    CompressedImage,
    Header,
    Image,
    Odometry,
    ParameterEvent,
    Path,
    PoseStamped,
)
from ros_visualise.errors import UsageError
from ros_visualise.messages import from_message, to_message, type_name
from ros_visualise.runtime.ros1.types import TYPES, message_class

STORE = get_typestore(Stores.ROS1_NOETIC)
HEADER = Header(1_700_000_000_987_654_321, "cam00_optical")


def numbers(*shape: int) -> Any:
    return np.random.default_rng(3).normal(size=shape)


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
    CameraInfo(375, 1242, numbers(3, 3), numbers(5), numbers(3, 3), numbers(3, 4)),
    CameraInfo.uncalibrated(480, 640),
]


def serialize(message: Any) -> bytes:
    if isinstance(getattr(message, "data", None), np.ndarray):
        message.data = message.data.tobytes()  # as rospy itself takes it
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


@pytest.mark.parametrize("data", DATA, ids=lambda data: type(data).__name__)
def test_data_survives(data: Any) -> None:
    kind = message_class(type(data))
    raw = serialize(to_message(data, TYPES, HEADER))
    found = from_message(kind().deserialize(raw), type(data))
    for name, value in vars(data).items():
        np.testing.assert_array_equal(getattr(found, name), value, err_msg=name)


@pytest.mark.parametrize("data", DATA, ids=lambda data: type(data).__name__)
def test_genpy_and_rosbags_write_the_same_bytes(data: Any) -> None:
    kind = type_name(type(data))
    ours = STORE.serialize_ros1(to_message(data, STORE.types, HEADER), kind)
    assert serialize(to_message(data, TYPES, HEADER)) == bytes(ours)


def test_every_message_is_of_the_class_that_its_topic_has() -> None:
    for data in DATA:
        assert type(to_message(data, TYPES)) is message_class(type(data))
    assert {type(data) for data in DATA} >= set(MESSAGES) - {ParameterEvent}


def test_what_ros_1_lacks_is_refused() -> None:
    with pytest.raises(UsageError, match="no message for ParameterEvent"):
        message_class(ParameterEvent)


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
