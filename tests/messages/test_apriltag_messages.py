"""Tags in the messages of AprilTag detectors, whose types only their recordings define."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from through import HEADER, through_ros1

from ros_visualise.data import Detections
from ros_visualise.messages import data_class
from ros_visualise.messages.definitions import Definitions, Encoding
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sinks.encoding import Encoder

LINE = "=" * 80
CORNERS = np.array([[10.0, 30], [32, 31], [30, 12], [11, 10]])
"""Lower left, lower right, upper right, upper left, as they are seen."""
PENN = f"""std_msgs/Header header
Apriltag[] apriltags
{LINE}
MSG: apriltag_msgs/Apriltag
int32 id
string family
int32 hamming
int32 border
int32 bits
geometry_msgs/Point center
geometry_msgs/Point[4] corners
"""
ROS_2 = f"""std_msgs/Header header
AprilTagDetection[] detections
{LINE}
MSG: apriltag_msgs/AprilTagDetection
string family
int32 id
int32 hamming
float32 goodness
float32 decision_margin
"""
POINTS = f"""Point centre
Point[4] corners
float64[9] homography
{LINE}
MSG: apriltag_msgs/Point
float64 x
float64 y
"""
NUMBERS = "float64[2] centre\nfloat64[8] corners\nfloat64[9] homography\n"
POSES = f"""std_msgs/Header header
AprilTagDetection[] detections
{LINE}
MSG: apriltag_ros/AprilTagDetection
int32[] id
float64[] size
geometry_msgs/PoseWithCovarianceStamped pose
"""

Make = Callable[[Any], Any]


def recorded(name: str, text: str, encoding: Encoding, make: Make) -> Recorded:
    """A message with the tags that ``make`` gives, of the types in ``text``."""
    types = Definitions(encoding)
    types.define(name, text)
    header = through_ros1(Detections((), HEADER)).header
    if encoding == "cdr":
        of = types.types
        stamp = of["builtin_interfaces/msg/Time"](header.stamp.sec, header.stamp.nanosec)
        header = of["std_msgs/msg/Header"](stamp, header.frame_id)
    array = types.types[name](header, make(SimpleNamespace(of=types.types)))
    return Recorded(name, bytes(types.write(name, array)), types, 77)


def penn(family: str, bits: int) -> Recorded:
    def make(here: Any) -> Any:
        point = here.of["geometry_msgs/msg/Point"]
        corners = [point(u, v, 0.0) for u, v in CORNERS]
        tag = here.of["apriltag_msgs/msg/Apriltag"]
        return [tag(42, family, 1, 1, bits, point(20.0, 21.0, 0.0), corners)]

    return recorded("apriltag_msgs/msg/ApriltagArrayStamped", PENN, "ros1", make)


def of_ros_2(are_points: bool) -> Recorded:
    def make(here: Any) -> Any:
        tag = here.of["apriltag_msgs/msg/AprilTagDetection"]
        if are_points:
            point = here.of["apriltag_msgs/msg/Point"]
            pixels: Any = point(20.5, 21.5), [point(u, v) for u, v in CORNERS + 0.5]
        else:
            pixels = np.array([20.5, 21.5]), (CORNERS + 0.5).ravel()
        return [tag("tag25h9", 7, 0, 0.0, 81.5, *pixels, np.eye(3).ravel())]

    text = ROS_2 + (POINTS if are_points else NUMBERS)
    return recorded("apriltag_msgs/msg/AprilTagDetectionArray", text, "cdr", make)


def posed(*ids: int) -> Recorded:
    def make(here: Any) -> Any:
        of = {name.rpartition("/")[2]: kind for name, kind in here.of.items()}
        pose = of["Pose"](of["Point"](1.0, 2.0, 3.0), of["Quaternion"](0.0, 0.6, 0.0, 0.8))
        stamped = of["PoseWithCovarianceStamped"](
            through_ros1(Detections((), HEADER)).header,
            of["PoseWithCovariance"](pose, np.zeros(36)),
        )
        tag = here.of["apriltag_ros/msg/AprilTagDetection"]
        return [tag(np.array(ids, np.int32), np.full(len(ids), 0.16), stamped)]

    return recorded("apriltag_ros/msg/AprilTagDetectionArray", POSES, "ros1", make)


@pytest.mark.parametrize(
    ("message", "name", "score"),
    [
        (penn("mit", 6), "tag36h11_42", 0.5),
        (penn("umich", 4), "tag16h5_42", 0.5),
        (penn("tf25h9", 5), "tag25h9_42", 0.5),
        (penn("", 9), "tag_42", 0.5),
        (of_ros_2(are_points=True), "tag25h9_7", 1.0),
        (of_ros_2(are_points=False), "tag25h9_7", 1.0),
    ],
)
def test_corners_are_those_of_the_image(message: Recorded, name: str, score: float) -> None:
    found = message.content
    assert isinstance(found, Detections)
    assert (found.header, len(found.detections)) == (HEADER, 1)
    tag = found.detections[0]
    assert (tag.class_id, tag.score, f"_{tag.id}") == (name, score, name[name.rindex("_") :])
    assert tag.hypotheses[0].number == int(tag.id)
    np.testing.assert_allclose(tag.corners_uv, CORNERS)
    np.testing.assert_allclose(tag.point_uv, [20, 21])
    np.testing.assert_allclose([tag.center_uv, tag.size_uv], [[21, 20.5], [22, 21]])


def test_a_pose_alone_is_kept_and_a_bundle_is_one_thing() -> None:
    tag = posed(3).content.detections[0]
    assert (tag.class_id, tag.id, tag.hypotheses[0].number) == ("tag_3", "3", 3)
    assert tag.hypotheses[0].position_xyz.tolist() == [1, 2, 3]
    assert tag.hypotheses[0].quat_xyzw.tolist() == [0, 0.6, 0, 0.8]
    assert np.isnan(tag.center_uv).all()
    assert len(tag.corners_uv) == 0
    bundle = posed(3, 5, 9).content.detections[0]
    assert (bundle.class_id, bundle.hypotheses[0].number) == ("tag_3_5_9", -1)


@pytest.mark.parametrize("message", [penn("mit", 6), of_ros_2(are_points=True), posed(3)])
def test_they_are_detections_on_a_graph_and_keep_their_type_in_recordings(
    message: Recorded,
) -> None:
    assert data_class(message.type_name) is Detections
    assert TopicType(message.type_name).data_class is Detections
    there = "cdr" if message.definitions.encoding == "ros1" else "ros1"
    encoder = Encoder(there)
    encoder.declare(TopicType(message.type_name, message.definitions))
    types = Definitions(there)
    types.define(message.type_name, encoder.declare(topic_of(message)).text)
    again = Recorded(message.type_name, bytes(encoder.encode(message)), types, 77)
    one, other = (found.content.detections[0] for found in (message, again))
    assert one.class_id == other.class_id
    np.testing.assert_array_equal(one.corners_uv, other.corners_uv)


def topic_of(message: Recorded) -> TopicType:
    return TopicType(message.type_name, message.definitions)
