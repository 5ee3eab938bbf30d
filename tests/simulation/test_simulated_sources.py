"""Simulated robots as sources: played, sought, set down anew, and told what to do."""

import itertools

import numpy as np
import pytest

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Odometry, PoseStamped, Twist
from ros_visualise.nodes import find
from ros_visualise.sources.playback import Playback

S = 10**9
START_X = 0.0
QUIET = {"camera": False, "lidar": False, "world": "plane"}


def make(robot, playback, **params):
    declared = find(robot)
    return declared.make(declared.params(**{**QUIET, **params}), playback)


def take(source, count):
    return list(itertools.islice(source.messages(), count))


def take_last(messages):
    *_, last = messages
    return last


@pytest.mark.parametrize("robot", ["husky", "quadrotor"])
def test_stamps_begin_at_zero_where_it_goes_as_fast_as_it_can(robot):
    messages = take(make(robot, Playback(rate=0)), 300)
    assert [name for name, _ in messages[:3]] == ["robot_description", "tf_static", "scenery"]
    stamps = [message.header.stamp_ns for _, message in messages]
    assert stamps == sorted(stamps)
    assert stamps[0] == 0
    assert stamps[-1] > S / 2
    assert {name for name, _ in messages} <= set(find(robot).outputs)


def test_started_later_it_lasts_as_long_as_asked():
    playback = Playback(rate=0, start_s=2, duration_s=1)
    messages = list(make("husky", playback, mission="square").messages())
    stamps = [message.header.stamp_ns for _, message in messages]
    assert (stamps[0], stamps[-1]) == (2 * S, pytest.approx(3 * S, abs=S / 50))
    names = [name for name, _ in messages]
    assert names[:3] == ["robot_description", "tf_static", "scenery"]
    assert names.count("truth") == 50


def test_it_ends_with_its_mission_when_nobody_looks_on(tmp_path):
    mission = tmp_path / "short.yaml"
    mission.write_text("waypoints: [[1, 0, 0], [2, 0, 0]]\nspeed: 0.9\n")
    playback = Playback(rate=0, duration_s=60)
    truth = [m for n, m in make("husky", playback, mission=str(mission)).messages() if n == "truth"]
    assert 2 < truth[-1].header.stamp_ns / S < 20
    np.testing.assert_allclose(truth[-1].position_xyz[:2], [2, 0], atol=0.3)


@pytest.fixture
def blocked(tmp_path):
    """A mission's file, into the playpen's fence."""
    mission = tmp_path / "blocked.yaml"
    mission.write_text("waypoints: [[0, 1.5, 0], [0, 20, 0]]\n")
    return {"world": "playpen", "mission": str(mission), "mission_timeout": 4.0}


def test_it_fails_with_its_mission_when_nobody_looks_on(blocked):
    playback = Playback(rate=0, duration_s=90)
    messages = make("husky", playback, **blocked).messages()
    with pytest.raises(RosVisualiseError, match=r"husky aborted its mission at \(.*for 4 s"):
        take_last(messages)
    assert 10 < playback.state.position_s < 60


def test_a_mission_that_fails_while_somebody_looks_on_is_told_once(blocked, caplog):
    playback = Playback(rate=0, duration_s=40, hold=True)
    _, last = take_last(make("husky", playback, **blocked).messages())
    assert last.header.stamp_ns > 39 * S
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith("husky aborted its mission at (")


def test_a_velocity_moves_it():
    source = make("husky", Playback(rate=0, duration_s=4))
    last = {}
    for name, message in source.messages():
        last[name] = message
        source.receive("cmd_vel", Twist(np.array([0.8, 0, 0]), np.zeros(3)))
    moved = last["truth"].position_xyz[0] - START_X
    assert isinstance(last["odom"], Odometry)
    assert 2.0 < moved < 3.3


def test_a_goal_is_flown_to():
    source = make("quadrotor", Playback(rate=0, duration_s=12))
    source.receive("goal", PoseStamped(np.array([2.0, 1.0, 3.0]), np.array([0, 0, 0, 1.0])))
    *_, last = (message for name, message in source.messages() if name == "truth")
    np.testing.assert_allclose(last.position_xyz, [2, 1, 3], atol=0.2)


def test_a_seek_goes_there_and_back():
    playback = Playback(rate=0, duration_s=30)
    source = make("husky", playback)
    messages = source.messages()
    for _, message in messages:
        if message.header.stamp_ns > S:
            break
    playback.seek(0.0)
    names = [next(messages)[0] for _ in range(3)]
    assert names == ["robot_description", "tf_static", "scenery"]
    playback.close()


def test_set_down_anew_it_goes_on_in_time():
    playback = Playback(rate=0, duration_s=30)
    source = make("husky", playback, mission="square")
    for name, message in source.messages():
        if message.header.stamp_ns == 4 * S and name == "truth":
            assert np.linalg.norm(message.position_xyz[:2]) > 0.5
            source.reset()
    assert playback.take_restart()
    again = take(make("husky", playback), 200)
    truth = [message for name, message in again if name == "truth"]
    odom = next(message for name, message in again if name == "odom")
    np.testing.assert_allclose(odom.position_xyz, 0, atol=1e-3)
    assert truth[0].header.stamp_ns >= 4 * S
    assert again[-1][1].header.stamp_ns < 6 * S
    assert abs(truth[0].position_xyz[0] - START_X) < 0.05


SEEING = {"camera": True, "camera_width": 32, "camera_height": 24, "camera_rate": 5.0}


def next_image(messages):
    return next(message for name, message in messages if name == "image")


@pytest.mark.usefixtures("opengl")
def test_sought_while_paused_the_image_of_that_time_is_shown():
    playback = Playback(rate=0, hold=True)
    messages = make("husky", playback, mission="square", **SEEING).messages()
    seen = {}
    while len(seen) < 12:
        image = next_image(messages)
        seen[image.header.stamp_ns] = image.pixels
    playback.pause()
    playback.seek(1.27)
    image = next_image(messages)
    assert playback.state.position_s == 1.2
    assert (image.pixels == seen[12 * S // 10]).all()
    playback.step(-1)
    assert (next_image(messages).pixels == seen[S]).all()
    playback.step(-1)
    playback.seek(0.0)
    assert (next_image(messages).pixels == seen[0]).all()
    playback.step(2)
    stepped = [next_image(messages) for _ in range(2)]
    assert (stepped[1].pixels == seen[4 * S // 10]).all()
    playback.close()


def test_steps_go_from_message_to_message_where_there_are_no_images():
    playback = Playback(rate=0, hold=True)
    messages = make("husky", playback).messages()
    start = [
        name for name, _ in itertools.takewhile(lambda message: message[0] != "status", messages)
    ]
    assert start[:8] == [
        *("robot_description", "tf_static", "scenery"),
        *("tf", "odom", "truth", "imu", "fix"),
    ]
    playback.pause()
    playback.step()
    name, message = next(messages)
    assert (name, message.header.stamp_ns) == ("imu", S // 100)
    playback.close()


def fly(told, action_s, again_s):
    """Heights by the second of a quadrotor that is told two velocities, up first, in turn."""
    source, heights = make("quadrotor", Playback(rate=0, duration_s=9)), []
    for name, message in source.messages():
        if name != "truth":
            continue
        stamp_s = message.header.stamp_ns / S
        if stamp_s % 1 == 0:
            heights.append(message.position_xyz[2])
        if stamp_s == action_s:
            source.act("take_off")
        z = 0.5 if stamp_s < 1 else told if stamp_s < again_s else -told
        if stamp_s < 7:
            source.receive("cmd_vel", Twist(np.array([0, 0, z]), np.zeros(3)))
    return heights


def test_an_action_ends_a_velocity_that_is_told_again_and_again():
    heights = fly(told=-0.1, action_s=2, again_s=10)
    assert heights[2] < 0.8
    assert heights[7] == pytest.approx(2.0, abs=0.1)


def test_after_an_action_another_velocity_counts():
    heights = fly(told=-0.1, action_s=2, again_s=5)
    assert heights[5] > 1.5
    assert heights[7] - heights[6] == pytest.approx(0.1, abs=0.05)
    assert heights[6] == pytest.approx(heights[5], abs=0.5)


def told_of(source, count):
    """What a robot says that it does, until it said so much, and when, in seconds."""
    said = []
    for name, message in source.messages():
        if name == "status":
            said.append(message.text)
            if len(said) == count:
                return said
        elif name == "truth":
            last_s = message.header.stamp_ns / S
            assert last_s < 200, said
    return said


def test_it_says_what_it_does_and_begins_again(tmp_path):
    mission = tmp_path / "hop.yaml"
    mission.write_text("waypoints: [[1, 0, 1.5], [2, 0, 1.5]]\nspeed: 2\n")
    playback = Playback(rate=0, hold=True)
    robot = make("quadrotor", playback, mission=str(mission), repeat=True)
    once = [
        "mission: flying to the route",
        "mission: waypoint 2 of 2",
        "mission: flying to the route",
        "landing",
        "mission over, landed",
    ]
    assert told_of(robot, 10) == [*once, *once]
    playback.close()


def test_a_mission_that_failed_is_begun_again_too(blocked):
    playback = Playback(rate=0, hold=True)
    said = told_of(make("husky", playback, **blocked, repeat=True), 4)
    assert said[0].startswith("mission: waypoint")
    failed = next(
        number for number, one in enumerate(said) if one.startswith("failed: husky aborted")
    )
    assert said[failed + 1].startswith("mission: waypoint")
    playback.close()
