"""Laws of localization in a map: honest from the first pose, and after the robot was moved."""

import numpy as np
import pytest
from driven import FALSE, drive, params
from seeds import runs
from world import (
    HERE,
    T0,
    Pose,
    S,
    World,
    along,
    map_text,
    square,
    surveyed,
    tags_on_ground,
)

SEEDS = runs(12, of=30)


def given(tmp_path, tags, sigma_m, sigma_rad, seed, **values):
    found, covariance = surveyed(tags, sigma_m, sigma_rad, seed)
    (tmp_path / "map.yaml").write_text(map_text(found, covariance))
    several = {"map": str(tmp_path / "map.yaml"), "mode": "frozen", "level_sigma": 0.5}
    return params(**several | values)


@pytest.mark.parametrize("count", [1, 2])
def test_a_pose_by_uncertain_tags_is_as_uncertain_as_they_are(count, tmp_path):
    """Robot and tags are correlated from the first moment: their errors are not counted twice."""
    tags = tags_on_ground([(3, 0.5, -5), (4.5, -1, -5)][:count])
    nees, below = [], []
    for seed in range(SEEDS):
        off = np.radians(1.5) * np.random.default_rng([seed, 7]).normal(size=3)
        world = World(along((0, 0, 0), (60, 0, 0), speed=1.5), tags, seed, mounted_rad=off)
        run = drive(world.events(3.5), given(tmp_path, tags, 0.2, 0.02, seed, camera_turn=1.5))
        assert run.poses, run.sentence(0, 9)
        nees.append(run.nees(world, size=6)[-1])
        below += [np.sqrt(np.linalg.eigvalsh(P[:3, :3])[0]) for *_, P in run.poses]
    told = f"NEES {np.mean(nees):.1f} of 6, sigma {min(below):.3f} m"
    assert min(below) > 0.98 * 0.2 / np.sqrt(count), told
    spread = 3 * np.sqrt(12 / SEEDS)
    assert abs(np.mean(nees) - 6) < spread, told


@pytest.mark.parametrize("off_deg", [(-1.5, 1.5, 1.5), (1.4, 1.4, -1.4)])
def test_the_first_poses_do_not_trust_the_cameras_mounting(off_deg, tmp_path):
    """What turns the camera turns the robot, until it is known which of them is off."""
    tags = tags_on_ground([(x, y, -5) for x in (0, 12) for y in (0, 12)])
    world = World(along(*square()), tags, mounted_rad=np.radians(off_deg))
    run = drive(world.events(6), given(tmp_path, tags, 1e-3, 1e-3, 0, camera_turn=1.5))
    assert run.nees(world, until_s=5, size=6).mean() < 8


def test_a_pose_found_again_is_honest_a_second_later(tmp_path):
    """The robot is moved 25 m; there are other tags."""
    near, far = [(x, y, -5) for x in (1, 4) for y in (-1, 1)], [(9, 24, -5), (10.5, 26, -5)]
    tags = tags_on_ground(near + far, side=0.6)
    nees, off, count = [], [], runs(6, of=12)
    for seed in range(count):
        world = World(
            along((0, 0, 0), (60, 0, 0), speed=2.0), tags, seed, kidnapped=(2.6, (2, 25, 0))
        )
        run = drive(world.events(6), given(tmp_path, tags, 0.1, 0.01, seed))
        after = [n for n, (t, *_) in enumerate(run.poses) if t > 2.6]
        right = [
            n
            for n in after
            if np.linalg.norm(run.poses[n][1].p - world.truth(run.poses[n][0]).p) < 3
        ]
        if not right:
            off.append(seed)
            continue
        found_s = run.poses[right[0]][0]
        nees.append(run.nees(world, found_s + 1, size=6)[:1])
    assert not off
    assert abs(np.mean(nees) - 6) < 3 * np.sqrt(12 / count), f"NEES {np.mean(nees):.1f} of 6"


def test_a_robot_that_sees_no_tag_of_its_map_is_said_once_to_be_not_localized(tmp_path):
    tags = tags_on_ground([(60, 0, -5)])
    world = World(along((0, 0, 0), (12, 0, 0), speed=0.8), tags)
    run = drive(world.events(35), given(tmp_path, tags, 0.02, 0.01, 0))
    assert not run.poses
    (line,) = (line for line in run.lines if "no map tag in view" in line)
    assert "no map tag in view for 10 s; not localized" in line


def test_the_only_tag_of_a_map_moves_no_robot_at_once():
    """It is wrong in four images, as in a fast turn."""
    tags, path = tags_on_ground([(1, 0, -5)], side=0.6), along((0, 0, 0), (3, 0, 0), speed=0.3)
    pose = tags["tag36h11_0"].pose
    moved = {
        "tag36h11_0": tags["tag36h11_0"]._replace(pose=Pose(pose.R, np.add(pose.p, (0.8, 0, 0))))
    }

    def is_wrong(one):
        return one.port == "detections" and 6 < one.arrival_s < 6.9

    right, wrong = World(path, tags).events(9), World(path, moved).events(9)
    events = [one for one in right if not is_wrong(one)] + [one for one in wrong if is_wrong(one)]
    events.sort(key=lambda one: one[:2])
    run = drive(events, params(), start=HERE)
    assert run.counted("image") > 40
    assert run.says("contradict")
    assert run.counted("loss") == 0


@pytest.mark.parametrize("count", [1, 2])
def test_what_relocalizes_a_robot_depends_on_the_tags_of_its_map(tmp_path, count):
    tags = tags_on_ground([(1, 0, -5), (2, 0, -5)][:count])
    way = along((0, 0, 0), (6, 0, 0), speed=0.5)
    world = World(way, tags, slides=[(3, 3.05, (100, 0, 0))])
    run = drive(world.events(4), given(tmp_path, tags, 0.02, 0.01, 0))
    needed = {1: "the only tag of the map is", 2: "two different map tags are"}[count]
    assert run.says(f"lost: the odometry jumped; {needed} needed to relocalize")


def test_without_tags_an_initial_pose_relocalizes():
    way = along((0, 0, 0), (6, 0, 0), speed=0.5)
    run = drive(World(way, {}, slides=[(3, 3.05, (100, 0, 0))]).events(4), params())
    assert run.says(r"jumped; an initial pose \(topic initialpose\) is needed to relocalize")


@pytest.mark.parametrize("there", ["one tag", "two tags"])
def test_a_robot_that_was_moved_is_not_falsely_certain(there, tmp_path):
    """From 2 s after the first sight that contradicts it."""
    near = [(x, y, -5) for x in range(0, 12, 3) for y in (-1, 1)]
    far = {"one tag": [(9, 25.5, -5)], "two tags": [(9, 24, -5), (10, 26, -5)]}[there]
    tags = tags_on_ground(near + far, side=0.6)
    world = World(
        along((0, 0, 0), (60, 0, 0), speed=1.0), tags, kidnapped=(6.2, (2, 25, 0)), seed=3
    )
    run = drive(world.events(12), given(tmp_path, tags, 0.02, 0.01, 0))
    seen_s = min(
        one.message.header.stamp_ns / S - T0
        for one in world.events(12)
        if one.port == "detections" and one.arrival_s > 6.2 and one.message.detections
    )
    from_s = seen_s + 2
    assert run.nees(world, 3, 6).max() < FALSE
    assert run.falsely_certain(world, from_s, 12) < 0.02, f"{run.off(world, from_s).max():.0f} m"
    assert run.says("contradict|moved|kidnap", 6.2)
