"""Laws of a gimbal whose angles are a little old: its turns are no offset of the camera's clock."""

import numpy as np
import pytest
from driven import drive, params
from world import HERE, Pose, Sensor, World, along, from_rpy, square, tags_on_ground


def sensors(clock_s=0.0, age_s=0.0):
    return {
        "odometry": Sensor(50),
        "images": Sensor(10, latency_s=0.1, clock_s=clock_s, priority=1),
        "imu": Sensor(100, priority=-1),
        "gimbal": Sensor(100, priority=-2),
        "gimbal_age_s": age_s,
    }


def swinging(way, size):
    """A way with roll and pitch; ``size`` is a function of time, rad and rad/s."""

    def path(t):
        swing, rate = size(t)
        return Pose(
            way(t).R @ from_rpy(swing * np.sin(rate * t), swing * np.cos(rate * t), 0), way(t).p
        )

    return path


def clock_ms(run):
    """Offset of the camera's clock and its standard deviation."""
    value = run.states[-1][1].values["camera 1 clock behind by (ms)"]
    return tuple(map(float, value.split(" +- ")))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_gust_over_one_tag_is_no_wrong_clock(seed):
    """150 degrees per second for a second, with angles 10 ms old: an error of 1.5 degrees."""
    path = swinging(
        along((0, 0, 0), (12, 0, 0), speed=1.0),
        lambda t: (0.2 * np.exp(-(((t - 6) / 0.7) ** 2)), 13),
    )
    world = World(path, tags_on_ground([(5, 0, -5)]), seed, **sensors(age_s=0.01))
    run = drive(world.events(9), params(), start=HERE)
    late_ms, sigma_ms = clock_ms(run)
    assert abs(late_ms) < 3 * sigma_ms
    assert not run.lines
    assert run.nees(world, 5).mean() < 6


@pytest.mark.parametrize("age_s", [0.0, 0.01])
def test_a_wrong_clock_is_named_though_the_gimbal_swings_fast(age_s):
    """80 ms, while the body turns by 150 degrees per second."""
    path = swinging(along(*square()), lambda t: (0.4 * (1 - np.exp(-((max(t, 0) / 3) ** 3))), 6.5))
    tags = tags_on_ground([(x, y, -5) for x in range(0, 13, 4) for y in range(0, 13, 4)])
    world = World(path, tags, **sensors(clock_s=0.08, age_s=age_s))
    run = drive(world.events(12), params(), start=HERE)
    late_ms, sigma_ms = clock_ms(run)
    assert abs(late_ms + 80) < 4 * sigma_ms
    assert run.says("the clock of camera 1 is [5-9][0-9] ms ahead")
    assert not run.says("less steady")
