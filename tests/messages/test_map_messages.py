"""Maps, outlines and arrays of poses in messages of nav_msgs and geometry_msgs, and back."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from through import HEADER, ROS1, ROS2, assert_survives, through_ros1, through_ros2

from ros_visualise.data import OccupancyGrid, PolygonStamped, PoseArray
from ros_visualise.messages import data_class, from_message
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import TopicType

CELLS = np.array([[0, 100, -1], [50, 1, -128]], np.int8)
GRID = OccupancyGrid(
    CELLS, 0.25, [-1.5, 2, 0.5], [0, 0, 0.6, 0.8], 1_600_000_000_000_000_001, HEADER
)
POLYGON = PolygonStamped(np.arange(12, dtype=np.float32).reshape(4, 3) / 4, HEADER)
POSES = PoseArray(np.arange(9.0).reshape(3, 3), np.arange(12.0).reshape(3, 4) / 7, HEADER)


@pytest.mark.parametrize(
    "data",
    [
        GRID,
        replace(GRID, cells=np.zeros((0, 0), np.int8)),
        POLYGON,
        PolygonStamped(np.zeros((0, 3)), HEADER),
        POSES,
        PoseArray(np.zeros((0, 3)), np.zeros((0, 4)), HEADER),
    ],
)
def test_maps_outlines_and_poses_survive(data: Any) -> None:
    assert_survives(data)


def test_cells_are_sent_row_by_row_from_the_origin() -> None:
    for through in (through_ros1, through_ros2):
        message = through(GRID)
        assert (message.info.width, message.info.height, message.info.resolution) == (3, 2, 0.25)
        assert list(message.data) == [0, 100, -1, 50, 1, -128]
        assert (message.info.origin.position.x, message.info.origin.orientation.z) == (-1.5, 0.6)
        assert message.info.map_load_time.sec == 1_600_000_000


def test_cells_are_not_copied() -> None:
    message = through_ros2(GRID)
    assert np.shares_memory(from_message(message, OccupancyGrid).cells, message.data)


def test_a_map_has_as_many_cells_as_it_says() -> None:
    message = through_ros2(GRID)
    message.info.height = 3
    with pytest.raises(ValueError, match="map of 3x3 cells, but the message holds 6"):
        from_message(message, OccupancyGrid)
    with pytest.raises(ValueError, match=r"not \(N, N\)"):
        OccupancyGrid(np.zeros(6, np.int8), 0.1)


def test_the_particles_of_nav2_are_poses_with_their_weights_left_behind() -> None:
    types = Definitions("cdr")
    types.define(
        "nav2_msgs/msg/ParticleCloud",
        "std_msgs/Header header\nParticle[] particles\n"
        f"{'=' * 80}\nMSG: nav2_msgs/Particle\ngeometry_msgs/Pose pose\nfloat64 weight",
    )
    of, sent = types.types, through_ros2(POSES)
    particles = [of["nav2_msgs/msg/Particle"](pose, 0.5) for pose in sent.poses]
    cloud = of["nav2_msgs/msg/ParticleCloud"](sent.header, particles)
    name = "nav2_msgs/msg/ParticleCloud"
    kind = TopicType(name).data_class
    assert kind is PoseArray
    found = from_message(types.read(name, bytes(types.write(name, cloud))), kind)
    assert np.array_equal(found.positions_xyz, POSES.positions_xyz)
    assert np.array_equal(found.quats_xyzw, POSES.quats_xyzw)
    assert found.header == HEADER


def test_they_have_classes() -> None:
    for name, kind in (
        ("nav_msgs/msg/OccupancyGrid", OccupancyGrid),
        ("geometry_msgs/msg/PolygonStamped", PolygonStamped),
        ("geometry_msgs/msg/PoseArray", PoseArray),
    ):
        assert data_class(name) is kind
        assert ROS1.knows(name)
        assert ROS2.knows(name)
