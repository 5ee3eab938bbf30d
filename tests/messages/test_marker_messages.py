"""Markers in messages of visualization_msgs, and back."""

from dataclasses import replace

import numpy as np
import pytest
from through import HEADER, ROS1, assert_same, assert_survives, through_ros1, through_ros2

from ros_visualise.data import Marker, MarkerAction, MarkerArray, MarkerType
from ros_visualise.messages import from_message

MARKER = Marker(
    MarkerType.LINE_STRIP,
    np.array([1.0, 2, 3]),
    np.array([0, 0, 0.6, 0.8]),
    np.array([0.1, 0, 0]),
    np.array([1, 0.5, 0.25, 0.75], np.float32),
    np.arange(9.0).reshape(3, 3),
    np.arange(12, dtype=np.float32).reshape(3, 4) / 12,
    text="ä",
    mesh_resource="package://robot/meshes/base.stl",
    mesh_use_embedded_materials=True,
    ns="lines",
    id=-7,
    action=MarkerAction.DELETE,
    lifetime_ns=2_500_000_000,
    frame_locked=True,
    header=HEADER,
)


@pytest.mark.parametrize("data", [MARKER, Marker(MarkerType.CUBE, header=HEADER)])
def test_markers_survive(data: Marker) -> None:
    assert_survives(data)


def test_several_markers_survive() -> None:
    several = MarkerArray((MARKER, replace(MARKER, id=8, type=MarkerType.POINTS)))
    for through in (through_ros1, through_ros2):
        found = from_message(through(several), MarkerArray)
        assert [one.id for one in found.markers] == [-7, 8]
        for one, other in zip(found.markers, several.markers, strict=True):
            assert_same(one, other)
    assert several.header == HEADER
    assert several.nbytes > 2 * 1000
    assert MarkerArray(()).header.frame_id == ""


def test_the_types_are_the_official_ones() -> None:
    assert ROS1.digest("visualization_msgs/msg/Marker") == "4048c9de2a16f4ae8e0538085ebf1b97"
    assert ROS1.digest("visualization_msgs/msg/MarkerArray") == "d155b9ce5188fbaf89745847fd5882d7"


def test_a_lifetime_that_ros_cannot_hold_is_refused() -> None:
    with pytest.raises(ValueError, match="duration"):
        through_ros2(replace(MARKER, lifetime_ns=2**62))
