"""Laws of a pose that the user states, for a robot that sees no tag of its map at the start."""

import numpy as np
import pytest
from driven import drive, params
from world import T0, Event, S, Sensor, World, along, from_rpy, map_text, quat_of, tags_on_ground

from ros_visualise.core.errors import ParameterError
from ros_visualise.data import Header, PoseWithCovarianceStamped
from ros_visualise.estimation.landmark_map import MapMode

RVIZ = np.diag([0.25, 0.25, 0, 0, 0, np.radians(15) ** 2])
"""The covariance of its button "2D Pose Estimate"."""
WAY = along((3, -2, 0), (23, -2, 0), speed=1.0)
TAGS = tags_on_ground([(x, -2, -5) for x in (11, 12.5, 14)], side=0.6)


def frozen(tmp_path, tags, **values):
    """Parameters with a map."""
    path = tmp_path / "map.yaml"
    path.write_text(map_text(tags, np.diag([0.02**2] * 3 + [0.01**2] * 3)))
    return params(mode=MapMode.FROZEN, map=str(path), **values)


@pytest.fixture
def known(tmp_path):
    """Parameters with a map whose tags the robot sees after some 6 s."""
    return lambda **values: frozen(tmp_path, TAGS, **values)


def stated(x, y, z=0.0, yaw=0.0, covariance=RVIZ, at_s=1.0, frame="map", quat=None):
    """A pose as RViz publishes it."""
    quat = quat_of(from_rpy(0, 0, yaw)) if quat is None else quat
    header = Header(round((at_s + T0) * S), frame)
    message = PoseWithCovarianceStamped(np.array([x, y, z]), quat, covariance, header)
    return Event(at_s, 5, "initialpose", message)


def events(until_s, *poses, **world):
    return sorted([*World(WAY, TAGS, **world).events(until_s), *poses], key=lambda one: one[:2])


@pytest.mark.parametrize("at_s", [-1.0, 1.0], ids=["before any odometry", "later"])
def test_a_robot_is_localized_where_the_user_says_until_tags_tell_it_better(known, at_s):
    truth = WAY(max(at_s, 0)).p
    one = stated(truth[0] + 0.4, truth[1] - 0.3, yaw=0.1, at_s=at_s)
    run, world = drive(events(9, one), known()), World(WAY, TAGS)
    assert run.poses[0][0] <= max(at_s, 0) + 0.2
    sigma = np.sqrt(np.diag(run.poses[0][2]))
    np.testing.assert_allclose(sigma[[0, 1, 5]], [0.5, 0.5, np.radians(15)], rtol=0.1)
    np.testing.assert_allclose(sigma[2:5], [2.0, *[np.radians(0.5)] * 2], rtol=0.2)
    assert run.nees(world, size=6).max() < 16
    assert run.off(world, 8).max() < 0.1 < run.off(world, 0, 5).min()
    assert run.counted("initial poses") == 1
    assert not run.says("lost")


def test_the_height_of_a_flying_robot_is_that_of_its_odometry(known):
    def climbing(t):
        return WAY(t)._replace(p=np.add(WAY(t).p, (0, 0, min(t, 4.0))))

    world = World(climbing, {})
    run = drive(
        sorted([*world.events(5), stated(6.0, -2.0, at_s=4.0)], key=lambda one: one[:2]), known()
    )
    assert abs(run.errors(world)[0][:, 2]).max() < 0.2


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (stated(np.nan, 0), "contains NaN"),
        (stated(1e9, 0), "beyond 1e.06 m"),
        (stated(0, 0, covariance=np.full((6, 6), np.inf)), "contains NaN or infinite"),
        (stated(0, 0, covariance=-RVIZ), "not symmetric and positive semidefinite"),
        (stated(0, 0, quat=np.zeros(4)), "not a unit quaternion"),
        (stated(0, 0, frame="odom"), "it is in the frame odom; give it in map"),
    ],
)
def test_a_pose_that_is_none_is_ignored_with_the_reason(known, given, why):
    run = drive(events(2, given), known())
    assert not run.poses
    assert run.says(f"ignoring the initial pose: .*{why}")


def test_a_pose_without_a_covariance_is_as_uncertain_as_by_hand(known):
    run = drive(events(2, stated(3.5, -2, covariance=np.zeros((6, 6)))), known())
    sigma = np.sqrt(np.diag(run.poses[0][2]))
    np.testing.assert_allclose(sigma[[0, 1, 5]], [0.5, 0.5, np.radians(15)], rtol=0.1)


@pytest.mark.parametrize("variance", [1e9, 1.7e308])
def test_a_pose_that_is_vague_beyond_all_numbers_is_corrected_by_tags(known, variance):
    run = drive(events(9, stated(3.5, -2, covariance=variance * np.eye(6))), known())
    assert run.off(World(WAY, TAGS), 8).max() < 0.1
    assert not run.says("contradict")


def test_a_vague_attitude_far_from_the_origin_is_corrected_by_tags(tmp_path):
    def way(t):
        return WAY(t)._replace(p=np.add(WAY(t).p, (1000, 1000, 0)))

    tags = tags_on_ground([(1000 + x, 998, -5) for x in (11, 12.5, 14)], side=0.6)
    world, vague = World(way, tags), np.diag([0.25, 0.25, *[1e9] * 4])
    one = stated(1003.5, 998, covariance=vague)
    several = sorted([*world.events(9), one], key=lambda one: one[:2])
    run = drive(several, frozen(tmp_path, tags))
    assert run.off(world, 8).max() < 0.1
    assert not run.says("contradict")


def test_a_pose_is_ignored_while_the_odometry_has_stopped_and_the_imu_goes_on(known):
    sensors = {"odometry": Sensor(20), "imu": Sensor(100, priority=-1)}
    stopped = [
        one
        for one in events(6, stated(9, -2, at_s=5), **sensors)
        if one.port != "odometry" or one.arrival_s < 3
    ]
    run = drive(stopped, known(start="3, -2, 0, 0"))
    assert run.says("ignoring the initial pose: the odometry has stopped")


def test_the_parameter_start_is_such_a_pose(known):
    run = drive(events(9), known(start="3.2, -2.1, 0, 5", start_sigma=0.3, start_yaw_sigma=6.0))
    world = World(WAY, TAGS)
    assert run.located() > 0.95
    sigma = np.sqrt(np.diag(run.poses[0][2]))
    np.testing.assert_allclose(sigma[[0, 1, 2, 5]], [0.3, 0.3, 0.3, np.radians(6)], rtol=0.1)
    assert run.nees(world).max() < 16
    for text in ("here", "1, 2, 3", "nan, 0, 0, 0"):
        with pytest.raises(ParameterError, match="give x, y, z in metres and yaw in degrees"):
            known(start=text)


def test_a_wrong_pose_is_found_out_by_the_tags(known):
    """8 m off, at a stated 0.5 m."""
    world = World(WAY, TAGS)
    run = drive(events(14, stated(3.5, 6.0)), known())
    assert run.says("contradict the estimated pose")
    assert run.off(world, 12).max() < 0.1
    assert run.falsely_certain(world, 8) == 0
