"""Laws of odometry and IMU: of two that disagree neither wins silently, and both come back."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from driven import drive, params
from seeds import runs
from world import (
    HERE,
    T0,
    Event,
    Pose,
    S,
    Sensor,
    World,
    along,
    exp,
    map_text,
    square,
    surveyed,
    tags_on_ground,
)

from ros_visualise.data import Header, Range

GRID = [(x, y, -5) for x in range(0, 13, 4) for y in range(0, 13, 4)]
TAGS = tags_on_ground(GRID)


def known_map(tmp_path, tags, **values):
    """Parameters with a map surveyed to 1 cm."""
    found, covariance = surveyed(tags, 0.01, 0.01, 0)
    (tmp_path / "map.yaml").write_text(map_text(found, covariance))
    given = {"map": str(tmp_path / "map.yaml"), "mode": "frozen", "level_sigma": 0.2}
    return params(**given | values)


FAULTS = {
    "stalls": {"slips": [(10, 10.6, 0.0), (15, 15.6, 0.0)]},
    "repeats its pose": {"frozen": [(10, 10.6), (15, 15.6)]},
    "slips": {"slips": [(10, 12, 0.5), (15, 16, 0.7)]},
    "jumps": {"slides": [(10, 10.1, (0, 2.5, 0)), (15, 15.1, (1, -1, 1))]},
}


@cache
def sigma_of_a_healthy_flight(given):
    healthy = World(along(*square()), TAGS, imu=Sensor(50, priority=-1))
    return last_sigma(drive(healthy.events(22), given))


def last_sigma(run):
    return np.sqrt(np.trace(run.poses[-1][2][:3, :3]))


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    """The tags as a map, one file for all."""
    return known_map(tmp_path_factory.mktemp("maps"), TAGS)


@pytest.mark.parametrize("fault", FAULTS)
def test_odometry_fails_and_comes_back(fault, known):
    world = World(along(*square()), TAGS, imu=Sensor(50, priority=-1), **FAULTS[fault])
    run = drive(world.events(22), known)
    assert run.located(3, 22) > 0.95, run.lines
    assert run.falsely_certain(world, 3, 22) < 0.02, run.nees(world, 3).max()
    assert run.off(world, 3).max() < 1.0
    assert run.counted("loss") == 0
    assert "used" in run.values["imu"], run.values["imu"]
    healthy = sigma_of_a_healthy_flight(known)
    assert last_sigma(run) < 1.5 * healthy, "one of them is no longer used"


def test_an_imu_in_a_wrong_frame_is_named_and_comes_back(tmp_path):
    turned = [(8, 13, exp([0, 0, 1.57]) @ exp([1.57, 0, 0]))]
    world = World(along(*square()), TAGS, imu=Sensor(50, priority=-1), imu_turned=turned)
    run = drive(world.events(22), known_map(tmp_path, TAGS))
    assert run.located(3, 22) > 0.95
    assert run.falsely_certain(world, 3, 22) < 0.05, run.nees(world, 3).max()
    assert run.counted("loss") == 0
    assert run.says("imu[^\n]*(contradict|disagree|frame)", 8)
    assert "used" in run.values["imu"], run.values["imu"]


def test_scales_that_change_in_flight_are_followed(tmp_path):
    """By 2%, twice the deviation that is given, between tags 20 m apart."""
    tags = tags_on_ground([(20 * n, 0.3, -5) for n in range(12)], side=0.6)
    several = []
    for seed in range(3):
        world = World(
            along((0, 0, 0), (300, 0, 0), speed=6.0),
            tags,
            seed,
            scales=[(0, 18, 0.01), (18, 99, -0.01)],
            walk=0.01,
        )
        run = drive(world.events(32), known_map(tmp_path, tags, odom_noise=0.01))
        several.append(run.nees(world, 18).mean())
    mean = float(np.mean(several))
    assert mean < 6, f"NEES {mean:.1f} of 3: {several}"


def test_covariance_in_the_odometry_is_used():
    """It states an error ten times that of the parameters, and has it."""
    several = []
    for seed in range(runs(5, of=10)):
        world = World(
            along((0, 0, 0), (300, 0, 0), speed=3.0),
            seed=seed,
            images=Sensor(0.01),
            walk=0.2,
            heading=np.radians(2.0),
            scale=0.0,
            states_covariance=True,
        )
        several.append(drive(world.events(12), params()).nees(world, 6).mean())
    mean = float(np.mean(several))
    assert mean < 6, f"NEES {mean:.1f} of 3: {several}"


def test_a_rangefinder_decides_between_imu_and_an_odometry_that_stalls():
    """No tag is in view, and the robot climbs 2.5 m meanwhile."""
    world = World(
        along((0, 0, 2), (40, 0, 42)),
        odometry=Sensor(50),
        imu=Sensor(100, priority=-1),
        slips=[(5.0, 6.2, 0.0)],
    )
    random = np.random.default_rng(3)
    events = world.events(12)
    for t in np.arange(0.3, 12, 0.05):
        R, p = world.truth(t)
        distance = p[2] / (R.T @ [0, 0, 1])[2] + random.normal(0, 0.02)
        at = Header(round((t + T0) * S), "below")
        events.append(Event(t, 2, "rangefinder", Range(distance, 0.1, 100.0, header=at)))
    run = drive(sorted(events, key=lambda one: one[:2]), params(), start=world.start())
    assert abs(run.errors(world, 6.5)[0][:, 2]).max() < 0.5
    assert run.falsely_certain(world) == 0
    assert run.counted("odometry rejected") > 5


def braking(t):
    """3 m/s, and from 6 s on braked by 6 m/s^2, hard for wheels."""
    after = np.clip(t - 6, 0, 0.5)
    return Pose(np.eye(3), np.array([3 * min(t, 6) + 3 * after - 3 * after**2, 0.0, 0.0]))


@pytest.mark.parametrize("hz", [10, 50])
def test_odometry_that_stalls_without_an_imu_may_have_missed_the_way(hz):
    """For 0.6 s at 3 m/s; a robot that brakes is none that stalls."""
    tags = tags_on_ground([(2, 0.5, -5), (3.5, 0.5, -5)])
    frozen = World(along((0, 0, 0), (60, 0, 0)), tags, odometry=Sensor(hz), frozen=[(6, 6.6)])
    run = drive(frozen.events(6.5), params(), start=HERE)
    assert run.off(frozen, 6.4).max() > 0.8
    assert run.nees(frozen, 5).max() < 16
    stops = World(braking, tags, odometry=Sensor(hz))
    run = drive(stops.events(8), params(), start=HERE)
    assert last_sigma(run) < 0.6  # a stall would add 1.5 m


def trembling(world, until_s, span, sigma_m):
    """The events of a world whose odometry has noise while it is frozen."""
    random = np.random.default_rng(0)
    for event in world.events(until_s):
        if event.port == "odometry" and span[0] <= event.arrival_s < span[1]:
            at = event.message.position_xyz + random.normal(0, sigma_m, 3)
            event = event._replace(message=replace(event.message, position_xyz=at))
        yield event


def test_odometry_that_trembles_where_it_has_stalled_wins_not_silently():
    """It stands for 3 s, to 2 cm, and the IMU goes on at 3 m/s; nothing else decides."""
    span = 6, 9
    sensors = {"odometry": Sensor(50), "imu": Sensor(100, priority=-1)}
    world = World(along((0, 0, 0), (60, 0, 0)), frozen=[span], **sensors)
    run = drive(list(trembling(world, 9, span, 0.02)), params(), start=HERE)
    assert run.says("odometry and IMU disagree")
    assert run.off(world, 8.5).max() > 5
    assert run.nees(world, 6).max() < 16


def test_odometry_that_stalls_at_low_speed_stops_no_imu():
    """Each of its steps is so short that the IMU's own error explains it; two tags are in view."""
    tags = tags_on_ground([(2, 0.5, -5), (3.5, 0.5, -5)])
    sensors = {"odometry": Sensor(50), "imu": Sensor(100, priority=-1)}
    world = World(along((0, 0, 0), (60, 0, 0), speed=0.5), tags, frozen=[(8, 11)], **sensors)
    run = drive(world.events(11.5), params(), start=HERE)
    assert run.says("odometry and IMU disagree")
    assert run.off(world, 8).max() < 0.4
    assert run.nees(world, 8).max() < 16


def test_odometry_that_stalls_in_the_first_seconds_wins_not_silently():
    """While it takes off, before the IMU has agreed with it for long; nothing else decides."""
    sensors = {"odometry": Sensor(50), "imu": Sensor(100, priority=-1)}
    world = World(along((0, 0, 0), (1, 0, 40)), frozen=[(1.5, 3)], **sensors)
    run = drive(world.events(2.9), params(), start=world.start())
    assert run.says("odometry and IMU disagree")
    assert run.off(world, 2.5).max() > 2
    assert run.nees(world, 0.5).max() < 25
