"""The numbers in a message, by the names of its fields."""

import numpy as np
import pytest
from through import HEADER, ROS1, ROS2, through_ros1, through_ros2

from ros_visualise.data import Imu, Odometry, PointCloud, Text, Transforms
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.numeric_fields import number_at, numeric_fields

IMU = Imu(
    [0, 0, 0.6, 0.8], [1, 2, 3], [4, 5, np.nan], angular_covariance=np.arange(9).reshape(3, 3)
)
ODOMETRY = Odometry([1, 2, 3], [0, 0, 0, 1], linear_xyz=[0.5, 0, 0], header=HEADER)


def test_numbers_have_the_names_that_ros_gives_them():
    found = numeric_fields(through_ros2(ODOMETRY))
    assert found["pose.pose.position.y"] == 2
    assert found["twist.twist.linear.x"] == 0.5
    assert found["header.stamp"] == pytest.approx(1_700_000_000.987654, abs=1e-6)
    assert "pose.covariance[35]" in found
    assert not [name for name in found if "frame_id" in name]
    assert all(type(value) is float for value in found.values())


def test_ros_1_numbers_its_messages():
    assert numeric_fields(through_ros1(ODOMETRY)).keys() == {
        "header.seq",
        *numeric_fields(through_ros2(ODOMETRY)),
    }


def test_short_arrays_are_taken_apart():
    found = numeric_fields(through_ros2(IMU))
    assert [found[f"angular_velocity_covariance[{i}]"] for i in range(9)] == list(range(9))
    assert np.isnan(found["linear_acceleration.z"])


def test_paths_stand_in_the_order_of_the_definition():
    paths = list(numeric_fields(through_ros2(IMU)))
    assert paths[:5] == ["header.stamp", *(f"orientation.{axis}" for axis in "xyzw")]
    assert paths[5] == "orientation_covariance[0]"
    assert paths[-1] == "linear_acceleration_covariance[8]"


@pytest.mark.parametrize("types", [ROS1, ROS2], ids=["ros1", "ros2"])
def test_every_kind_of_field(types):
    types = Definitions(types.encoding)
    duration = "duration" if types.encoding == "ros1" else "builtin_interfaces/Duration"
    types.define(
        "robot/msg/State",
        f"int8 MODE=3\nbool on\nint64 big\nuint8 mode\nfloat32 level\nstring name\n{duration} age\n"
        "float64[3] triple\nint32[] few\nbool[2] flags\nuint8[4] raw\nstring[2] names\n"
        "float32[10] many\nfloat64[] none\ngeometry_msgs/Point[] points\ngeometry_msgs/Point at",
    )
    of = types.types
    point = of["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=3.0)
    message = of["robot/msg/State"](
        on=True,
        big=-(2**53),
        mode=7,
        level=0.5,
        name="7",
        age=of["builtin_interfaces/msg/Duration"](sec=-1, nanosec=250_000_000),
        triple=np.array([1.0, 2.0, 3.0]),
        few=np.array([4, 5], np.int32),
        flags=np.array([True, False]),
        raw=np.array([0, 1, 2, 255], np.uint8),
        names=["1", "2"],
        many=np.zeros(10, np.float32),
        none=np.zeros(0),
        points=[point],
        at=point,
    )
    read = types.read("robot/msg/State", bytes(types.write("robot/msg/State", message)))
    assert numeric_fields(read) == {
        "on": 1,
        "big": -(2.0**53),
        "mode": 7,
        "level": 0.5,
        "age": -0.75,
        "triple[0]": 1,
        "triple[1]": 2,
        "triple[2]": 3,
        "few[0]": 4,
        "few[1]": 5,
        "flags[0]": 1,
        "flags[1]": 0,
        "raw[0]": 0,
        "raw[1]": 1,
        "raw[2]": 2,
        "raw[3]": 255,
        **{f"many[{n}]": 0 for n in range(10)},
        "points[0].x": 1,
        "points[0].y": 2,
        "points[0].z": 3,
        "at.x": 1,
        "at.y": 2,
        "at.z": 3,
    }


def test_arrays_may_change_their_lengths():
    kind = "std_msgs/msg/Float64MultiArray"
    of = ROS2.types
    layout = of["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    lengths = [
        len(numeric_fields(of[kind](layout=layout, data=np.zeros(length)))) for length in (0, 9, 36)
    ]
    assert lengths == [1, 10, 37]


def test_a_message_may_hold_one_number_or_none():
    assert numeric_fields(through_ros1(Text("5"))) == {}
    assert numeric_fields(through_ros1(Transforms(()))) == {}
    assert numeric_fields(ROS1.types["std_msgs/msg/Int16"](data=5)) == {"data": 5}


def test_a_cloud_gives_its_sizes():
    points = np.zeros(1000, [("x", "<f4")])
    found = numeric_fields(through_ros2(PointCloud(points)))
    assert (found["width"], found["point_step"], found["is_dense"]) == (1000, 4, 1)
    assert not [name for name in found if name.startswith("data")]


def test_each_number_is_found_again_by_its_path():
    for message in map(through_ros2, (ODOMETRY, IMU)):
        found = numeric_fields(message)
        assert len(found) > 36
        assert {path: number_at(path, message) for path in found} == found


def test_a_path_that_leads_nowhere_gives_nan():
    message = through_ros2(ODOMETRY)
    for path in (
        "",
        "no",
        "pose.covariance[36]",
        "header.frame_id",
        "__class__",
        "pose[0]",
        "pose",
    ):
        assert np.isnan(number_at(path, message)), path
