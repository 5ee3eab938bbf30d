"""Detections in messages of vision_msgs, of ROS 1 and of ROS 2, and back."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from through import (
    HEADER,
    ROS1,
    ROS2,
    assert_same,
    assert_survives,
    through_ros1,
    through_ros2,
)

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import (
    Detection,
    Detection3D,
    Detections,
    Detections3D,
    Header,
    Hypothesis,
    VisionInfo,
)
from ros_visualise.messages import data_class, from_message
from ros_visualise.messages.definitions import Definitions, Encoding
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks.encoding import Encoder

SEEN = Hypothesis("7", 0.75, np.arange(3.0), np.array([0, 0, 0.6, 0.8]), np.eye(6) / 3, 7)
GUESS = Hypothesis("12", 0.125, number=12)
BOX = Detection(np.array([320.5, 240.25]), np.array([100.0, 50]), 0.5, (GUESS, SEEN))
SPACE = Detection3D(np.arange(3.0), np.array([0, 0, 0.6, 0.8]), np.array([1, 2, 0.5]), (SEEN,))
FOUND = [
    Detections((BOX, replace(BOX, hypotheses=())), HEADER),
    Detections((), HEADER),
    Detections3D((SPACE,), HEADER),
]


def assert_same_found(found: Any, data: Any, numbered: bool = True) -> None:
    """Numbers of classes do not travel in ROS 2, which has their names."""
    assert found.header == data.header
    for one, other in zip(found.detections, data.detections, strict=True):
        for hypothesis, there in zip(one.hypotheses, other.hypotheses, strict=True):
            number = there.number if numbered else -1
            assert_same(hypothesis, replace(there, number=number))
        assert_same(replace(one, hypotheses=()), replace(other, hypotheses=()))


@pytest.mark.parametrize("through", [through_ros1, through_ros2])
@pytest.mark.parametrize("data", FOUND)
def test_detections_survive(data: Any, through: Callable[[Any], Any]) -> None:
    assert_same_found(from_message(through(data), type(data)), data, through is through_ros1)


def test_names_and_tracks_survive_in_ros_2_alone() -> None:
    named = Detections((replace(BOX, hypotheses=(Hypothesis("dog", 0.5),), id="track 3"),), HEADER)
    assert_same_found(from_message(through_ros2(named), Detections), named)
    with pytest.raises(ValueError, match="'dog'"):
        through_ros1(named)
    numbered = Detections((replace(BOX, id="track 3"),), HEADER)
    assert from_message(through_ros1(numbered), Detections).detections[0].id == ""


def test_a_class_with_a_number_is_that_number_in_ros_1() -> None:
    dog = Detections((replace(BOX, hypotheses=(Hypothesis("dog", 0.5, number=16),)),), HEADER)
    found = from_message(through_ros1(dog), Detections).detections[0].hypotheses[0]
    assert (found.class_id, found.number) == ("16", 16)
    assert from_message(through_ros2(dog), Detections).detections[0].class_id == "dog"


def test_a_class_of_a_megabyte_is_told_of_in_a_few_words() -> None:
    vast = Detections((replace(BOX, hypotheses=(Hypothesis("A" * 10**6, 0.5),)),), HEADER)
    with pytest.raises(ValueError, match=r"class 'AAA.*\.\.\..*give its number") as refused:
        through_ros1(vast)
    assert len(str(refused.value)) < 120


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("Detection2DArray", "402071f61477de256df9f1aa45e6e4c8"),
        ("Detection3DArray", "05c51d9aea1fb4cfdc8effb94f197b6f"),
        ("VisionInfo", "eee36f8dc558754ceb4ef619179d8b34"),
    ],
)
def test_the_types_of_ros_1_are_the_official_ones(name: str, digest: str) -> None:
    assert ROS1.digest(f"vision_msgs/msg/{name}") == digest


def test_the_types_of_ros_2_are_those_of_vision_msgs_4() -> None:
    text = ROS2.text("vision_msgs/msg/Detection2DArray")
    parts = dict(part.split("\n", 1) for part in text.split("=" * 80 + "\nMSG: ")[1:])
    assert parts["vision_msgs/ObjectHypothesis"].split() == [
        *("string", "class_id"),
        *("float64", "score"),
    ]
    assert parts["vision_msgs/Pose2D"].split() == [
        *("vision_msgs/Point2D", "position"),
        *("float64", "theta"),
    ]


def test_messages_of_before_humble_are_read() -> None:
    types = Definitions("cdr")
    line = "=" * 80
    types.define(
        "vision_msgs/msg/Detection2DArray",
        "std_msgs/Header header\nDetection2D[] detections\n"
        f"{line}\nMSG: vision_msgs/Detection2D\nstd_msgs/Header header\n"
        "ObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nbool is_tracking\n"
        "string tracking_id\n"
        f"{line}\nMSG: vision_msgs/BoundingBox2D\ngeometry_msgs/Pose2D center\n"
        "float64 size_x\nfloat64 size_y\n"
        f"{line}\nMSG: vision_msgs/ObjectHypothesisWithPose\nstring id\nfloat64 score\n"
        "geometry_msgs/PoseWithCovariance pose\n",
    )
    of = types.types
    pose = of["geometry_msgs/msg/PoseWithCovariance"](
        of["geometry_msgs/msg/Pose"](
            of["geometry_msgs/msg/Point"](1.0, 2.0, 3.0),
            of["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        ),
        np.zeros(36),
    )
    header = through_ros2(FOUND[0]).header
    kind = "vision_msgs/msg/"
    box = of[f"{kind}BoundingBox2D"](of["geometry_msgs/msg/Pose2D"](5.0, 6.0, 0.5), 7.0, 8.0)
    said = of[f"{kind}ObjectHypothesisWithPose"]("dog", 0.5, pose)
    empty = replace(header, stamp=replace(header.stamp, sec=0, nanosec=0), frame_id="")
    array = of[f"{kind}Detection2DArray"](
        empty, [of[f"{kind}Detection2D"](header, [said], box, True, "4")]
    )
    raw = bytes(types.write(f"{kind}Detection2DArray", array))
    found = from_message(types.read(f"{kind}Detection2DArray", raw), Detections)
    assert found.header == HEADER  # of the detection, where the array has none
    one = found.detections[0]
    assert (one.class_id, one.score, one.theta) == ("dog", 0.5, 0.5)
    assert one.center_uv.tolist() == [5, 6]
    assert one.size_uv.tolist() == [7, 8]


def test_the_likeliest_class_is_that_of_a_detection() -> None:
    assert (BOX.class_id, BOX.score) == ("7", 0.75)
    assert (Detection(np.zeros(2), np.zeros(2)).class_id, Detections(()).header) == ("", Header())


def test_the_outline_is_that_of_the_turned_box_or_of_the_corners() -> None:
    expected = cv2.boxPoints(((320.5, 240.25), (100.0, 50.0), np.degrees(0.5)))
    ours = {tuple(np.round(corner, 2)) for corner in BOX.outline_uv}
    assert ours == {tuple(np.round(corner.astype(float), 2)) for corner in expected}
    corners = [[0, 0], [10, 2], [9, 12], [-1, 10]]
    tag = Detection.of_corners(corners, [SEEN], "5")
    assert tag.outline_uv.tolist() == corners
    box = replace(tag, corners_uv=np.zeros((0, 2))).outline_uv.astype(np.float32)
    assert all(cv2.pointPolygonTest(box, corner, True) > -0.01 for corner in corners)


def test_they_have_classes() -> None:
    assert data_class("vision_msgs/msg/Detection2DArray") is Detections
    assert data_class("vision_msgs/msg/Detection3DArray") is Detections3D


@pytest.mark.parametrize("encodings", [("ros1", "cdr"), ("cdr", "ros1")])
@pytest.mark.parametrize("data", FOUND)
def test_recorded_ones_are_converted_to_the_other_ros(
    data: Any, encodings: tuple[Encoding, Encoding]
) -> None:
    here, there = Encoder(encodings[0]), Encoder(encodings[1])
    name = data.type_name
    recorded = Recorded(name, here.encode(data), Definitions(encodings[0]), 0)
    there.declare(TopicType(name, recorded.definitions))
    converted = Definitions(encodings[1]).read(name, bytes(there.encode(recorded)))
    assert_same_found(from_message(converted, type(data)), data, encodings[1] == "ros1")


def test_the_names_of_classes_are_told_of_on_both_ros() -> None:
    assert_survives(VisionInfo("helipads", "/landmark_detector/class_names", 2, HEADER))


def test_a_recorded_name_that_ros_1_cannot_hold_is_said() -> None:
    named = Detections((replace(BOX, hypotheses=(Hypothesis("dog", 0.5),)),), HEADER)
    recorded = Recorded(Detections.type_name, Encoder("cdr").encode(named), ROS2, 0)
    with pytest.raises(DamagedMessage, match="'dog'"):
        Encoder("ros1").encode(recorded)
