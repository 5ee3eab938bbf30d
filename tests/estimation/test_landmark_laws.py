"""Laws of landmarks: right ones stay, false ones go, and what they share is counted once."""

import re
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from driven import drive, params
from world import (
    HERE,
    T0,
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

GRID = [(x, y, -5) for x in range(0, 13, 4) for y in range(0, 13, 4)]
TAGS = tags_on_ground(GRID)


def mapped(tmp_path, tags, sigma):
    """A map file of tags, surveyed with this deviation, metres and radians."""
    found, covariance = surveyed(tags, sigma, sigma, 0)
    path = tmp_path / "map.yaml"
    path.write_text(map_text(found, covariance))
    return str(path)


def test_false_detections_leave_nothing_behind():
    """In 30% of the images a false tag, each with a name of its own."""
    world = World(along(*square()), TAGS, clutter=0.3, images=Sensor(10, priority=1))
    run = drive(world.events(11), params())
    _, used, candidates = run.counts[-1]
    assert used <= len(TAGS)
    assert candidates <= len(TAGS) + 10, f"{candidates} landmarks for {len(TAGS)} tags"


def test_an_imu_without_odometry_fills_no_memory():
    world = World(along(*square()), imu=Sensor(100, priority=-1))
    first = [one for one in world.events(1) if one.port != "detections"][:-1]
    run, message = drive(first, params()), first[-2].message
    assert message.header.frame_id == "imu_link"
    later = [
        replace(message, header=replace(message.header, stamp_ns=(T0 + 2) * S + n * S // 100))
        for n in range(4000)
    ]
    tracemalloc.start()
    try:
        drive([first[-2]._replace(message=one) for one in later], params(), run=run)
        grown = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert grown < 500_000, f"{grown / 1e6:.1f} MB for {len(later)} messages"


def hovering(t):
    """A robot that keeps its place to a few centimetres."""
    swing = np.array([np.sin(0.7 * t), np.sin(1.1 * t), np.sin(0.4 * t)]) * (1 - np.exp(-t))
    return Pose(exp(0.02 * swing), 0.05 * swing)


@pytest.mark.parametrize("mode", ["frozen", "build"])
def test_right_tags_are_not_dropped_over_thousands_of_views(mode, tmp_path):
    """Twelve tags in view, of which the robot learns nothing new by its motion."""
    tags = tags_on_ground([(x, y, -5) for x in (-1.5, 0, 1.5) for y in (-1.5, -0.5, 0.5, 1.5)])
    given = params(mode=mode, map=mapped(tmp_path, tags, 0.005), level_sigma=0.2)
    views, refused, dropped = 0, 0, []
    for seed in range(2):
        events = World(hovering, tags, seed, images=Sensor(8, priority=1)).events(9)
        views += sum(len(one.message.detections) for one in events if one.port == "detections")
        run = drive(events, given)
        whole = [value for _, one in run.states for value in one.values.values()]
        dropped += [one for one in whole if re.search("anew|several places", one)]
        refused += sum(name.startswith("rejected") for _, one in run.states for name in one.values)
    assert views > 1500
    assert not dropped, f"{len(dropped)} of {2 * len(tags)} tags"
    assert refused < 0.005 * views, f"{refused} of {views} views"


def test_one_wrong_height_of_the_ground_is_one_error():
    """Ten posts do not make it smaller: by the odometry's scale they lead the robot astray."""
    random = np.random.default_rng(5)
    several, posts_off = [], []
    for seed in range(4):
        height = -5 + 0.4 * (-1) ** seed  # two deviations
        posts = np.column_stack(
            [random.uniform(2, 30, 10), random.uniform(-2, 2, 10), np.full(10, height)]
        )
        world = World(along((0, 0, 0), (90, 0, 0), speed=2.0), posts=posts, seed=seed, scale=0.0)
        run = drive(world.events(16), params(ground_height=-5.0, ground_sigma=0.2, odom_scale=0.1))
        several.append(run.nees(world, 8).mean())
        for one in run.landmarks.values():
            near = posts[np.argmin(np.linalg.norm(posts - one.position_xyz, axis=1))]
            off = one.position_xyz - near
            posts_off.append(off @ np.linalg.solve(one.hypotheses[0].covariance[:3, :3], off))
    assert len(posts_off) >= 30
    assert np.mean(several) < 9, f"NEES of the robot {np.mean(several):.1f} of 3: {several}"
    assert np.mean(posts_off) < 9, f"NEES of the posts {np.mean(posts_off):.1f} of 3"


@pytest.mark.parametrize(("factor", "seed", "is_named"), [(0.96, 6, False), (1.05, 8, True)])
def test_a_tag_printed_at_another_size_pulls_nothing(factor, seed, is_named):
    """A copy of a tag, or one that a printer scaled, would move the robot at each metre."""
    name = "tag36h11_4"
    tags = {**TAGS, name: TAGS[name]._replace(side=TAGS[name].side / factor)}
    world = World(along(*square()), tags, seed=seed, size_factors={name: factor})
    run = drive(world.events(30), params(level_sigma=0.2, camera_turn=0.5), start=HERE)
    assert name in run.landmarks
    assert run.falsely_certain(world, 3) == 0
    assert run.nees(world, 3).mean() < 9
    named = [line for line in run.lines if "check the tag size" in line]
    assert len(named) == is_named, named
    assert all(f"{name} is 3" in line and "smaller than stated" in line for line in named)


def test_sizes_that_are_all_wrong_are_named(tmp_path):
    """By 10%, from the detector's parameter."""
    world = World(along(*square()), TAGS, size_factor=1.1)
    given = params(mode="frozen", map=mapped(tmp_path, TAGS, 0.01), level_sigma=0.2)
    run = drive(world.events(10), given)
    assert "size" in run.sentence(4, 10), run.sentence(4, 10)
    assert run.falsely_certain(world, 4, 10) < 0.02, f"{run.off(world, 4).max():.2f} m off"
