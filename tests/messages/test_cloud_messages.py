"""Point clouds of any layout in messages of sensor_msgs, and back."""

from dataclasses import replace

import numpy as np
import pytest
from through import HEADER, ROS1, ROS2, through_ros1, through_ros2

from ros_visualise.data import PointCloud
from ros_visualise.messages import from_message, to_message

XYZI = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
ALL_TYPES = np.dtype(
    [(f"f_{kind}", "<" + kind) for kind in ("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8")]
)
GAPS = np.dtype(  # as PCL has it: 16 bytes for x, y, z; colours of two names; a descriptor
    {
        "names": ["z", "x", "y", "rgb", "rgba", "descriptor"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u4", ("<f4", (3,))],
        "offsets": [8, 0, 4, 16, 16, 20],
        "itemsize": 48,
    }
)
LAYOUTS = {
    "xyzi": XYZI,
    "all types": ALL_TYPES,
    "gaps": GAPS,
    "big endian": XYZI.newbyteorder(">"),
    "one byte": np.dtype([("label", "u1")]),
}


def random_points(dtype, *shape):
    size = dtype.itemsize * int(np.prod(shape))
    return np.random.default_rng(3).integers(0, 256, size, np.uint8).view(dtype).reshape(shape)


def assert_same_points(found, points):
    assert found.dtype.names == points.dtype.names
    assert found.shape == points.shape
    for name in points.dtype.names:
        assert found.dtype[name] == points.dtype[name]
        assert found[name].tobytes() == points[name].tobytes(), name  # NaN too


@pytest.mark.parametrize("shape", [(5,), (1,), (0,), (3, 4), (2, 1)])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("through", [through_ros1, through_ros2])
def test_clouds_survive(through, layout, shape):
    points = random_points(LAYOUTS[layout], *shape)
    cloud = PointCloud(points, False, HEADER)
    found = from_message(through(cloud), PointCloud)
    assert_same_points(found.points, points)
    assert (found.is_dense, found.header) == (False, HEADER)
    assert found.points.dtype.itemsize == points.dtype.itemsize


def test_a_message_says_how_its_bytes_are_laid_out():
    message = through_ros2(PointCloud(random_points(GAPS, 3, 4)))
    assert (message.height, message.width, message.point_step, message.row_step) == (3, 4, 48, 192)
    assert [(f.name, f.offset, f.datatype, f.count) for f in message.fields] == [
        ("z", 8, 7, 1),
        ("x", 0, 7, 1),
        ("y", 4, 7, 1),
        ("rgb", 16, 7, 1),
        ("rgba", 16, 6, 1),
        ("descriptor", 20, 7, 3),
    ]
    assert not message.is_bigendian
    types = through_ros2(PointCloud(random_points(ALL_TYPES, 1))).fields
    assert [f.datatype for f in types] == [1, 2, 3, 4, 5, 6, 7, 8]


def test_points_are_copied_neither_way():
    points = random_points(XYZI, 1000)
    message = to_message(PointCloud(points), ROS2.types)
    assert np.shares_memory(message.data, points)
    found = from_message(message, PointCloud)
    assert np.shares_memory(found.points, points)
    with pytest.raises(ValueError, match="read-only"):
        found.points["x"] = 0


def test_a_part_of_a_cloud_is_written_as_it_looks():
    points = random_points(GAPS, 6, 8)
    found = from_message(through_ros1(PointCloud(points[1:5:2, ::3])), PointCloud)
    assert_same_points(found.points, points[1:5:2, ::3])


def test_both_byte_orders_at_once_become_one():
    points = np.array([(1.5, 7)], np.dtype([("x", ">f4"), ("n", "<u2")]))
    found = from_message(through_ros2(PointCloud(points)), PointCloud)
    assert found.points.tolist() == [(1.5, 7)]
    assert found.points.dtype["x"] == np.dtype("<f4")


def message(types=ROS1, **changes):
    return replace(to_message(PointCloud(random_points(XYZI, 2, 3)), types.types), **changes)


def test_padding_at_the_rows_ends_is_left_out():
    sent = message()
    padded = np.zeros((2, 60), np.uint8)
    padded[:, :48] = np.reshape(sent.data, (2, 48))
    found = from_message(replace(sent, row_step=60, data=padded.ravel()), PointCloud)
    assert_same_points(found.points, random_points(XYZI, 2, 3))
    assert np.shares_memory(found.points, padded)


def test_a_message_made_of_bytes_is_read_as_well():
    found = from_message(message(data=message().data.tobytes()), PointCloud)
    assert_same_points(found.points, random_points(XYZI, 2, 3))


def test_the_coordinates_come_as_columns():
    for layout in ("xyzi", "gaps", "big endian"):
        points = random_points(LAYOUTS[layout], 2, 3)
        xyz = from_message(through_ros1(PointCloud(points)), PointCloud).xyz
        assert (xyz.shape, xyz.dtype) == ((6, 3), np.float32)
        for column, name in enumerate("xyz"):
            np.testing.assert_array_equal(xyz[:, column], points[name].ravel())


def fields(*rows):
    kind = ROS1.types["sensor_msgs/msg/PointField"]
    return [kind(name=n, offset=o, datatype=t, count=c) for n, o, t, c in rows]


def test_fields_without_a_name_are_padding_and_a_count_of_none_is_one():
    found = from_message(message(fields=fields(("x", 0, 7, 0), ("", 4, 2, 12))), PointCloud)
    assert found.points.dtype.names == ("x",)
    np.testing.assert_array_equal(found.points["x"], random_points(XYZI, 2, 3)["x"])


@pytest.mark.parametrize(("height", "width"), [(0, 0), (1, 0), (0, 7)])
def test_a_cloud_of_no_points_may_say_nothing_of_them(height, width):
    none = {"height": height, "width": width, "data": b"", "row_step": 0}
    assert from_message(message(**none, point_step=0), PointCloud).points.shape == (0,)
    assert from_message(message(**none, point_step=0, fields=[]), PointCloud).points.nbytes == 0


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"width": 4}, r"4x2 points of 16 bytes in rows of 48 needs 128 bytes, .* holds 96"),
        ({"height": 3}, "needs 144 bytes, but the message holds 96"),
        ({"row_step": 47}, "in rows of 47 needs 96 bytes"),
        ({"row_step": 50}, "in rows of 50 needs 100 bytes"),
        ({"data": np.zeros(95, np.uint8)}, "holds 95"),
        ({"data": np.zeros(0, np.uint8)}, "holds 0"),
        (
            {"point_step": 0, "row_step": 0, "fields": [], "data": np.zeros(0, np.uint8)},
            "a cloud of 3x2 points, each of 0 bytes",
        ),
        ({"height": 0}, "needs 0 bytes, but the message holds 96"),
        ({"point_step": 15}, "the fields of a point need 16 bytes, but the step is 15"),
        ({"fields": fields(("x", 13, 7, 1))}, "need 17 bytes, but the step is 16"),
        ({"fields": fields(("x", 0, 7, 5))}, "need 20 bytes, but the step is 16"),
        ({"fields": fields(("x", 0, 9, 1))}, "field 'x' is of type 9"),
        ({"fields": fields(("x", 0, 0, 1))}, "field 'x' is of type 0"),
        ({"fields": fields(("x", 0, 7, 1), ("x", 4, 7, 1))}, "share a name: x, x"),
    ],
)
def test_what_contradicts_itself_is_refused(changes, why):
    with pytest.raises(ValueError, match=why):
        from_message(message(**changes), PointCloud)


@pytest.mark.parametrize("kind", ["<i8", "?", "<c8", "U3", [("inner", "<f4")]])
def test_what_a_message_cannot_hold_is_refused_by_name(kind):
    with pytest.raises(
        ValueError, match=r"field 'odd' of a cloud is .*PointCloud2 does not support"
    ):
        to_message(PointCloud(np.zeros(2, [("odd", kind)])), ROS2.types)
