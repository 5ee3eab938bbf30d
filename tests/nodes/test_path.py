"""The path: what of the odometry it keeps, and when it is published."""

import math
from dataclasses import replace
from pathlib import Path as File

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from ros_visualise.data import Header, Odometry, Path
from ros_visualise.messages import from_message
from ros_visualise.nodes.path import PathNode, PathParams
from ros_visualise.pipelines import path_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.queues import Packet

EACH = PathParams(min_distance=0, min_angle=0, rate=0)


def odometry(x=0.0, yaw=0.0, time_s=0.0, frame="odom"):
    """At x metres, turned by yaw degrees."""
    half = math.radians(yaw) / 2
    quat = np.array([0, 0, math.sin(half), math.cos(half)])
    header = Header(round(time_s * 1e9) + 10**18, frame)
    return Odometry(np.array([x, 2.0, 3.0]), quat, header=header)


def run(messages, params=EACH):
    """The paths, and the node."""
    path = PathNode(params)
    return [path.step(message, params) for message in messages], path


def published(messages, params):
    answers, path = run(messages, params)
    return [answer for answer in (*answers, path.finish()) if answer is not None]


def test_it_holds_the_poses_in_the_odometrys_frame_with_its_stamps():
    messages = [odometry(x, 90 * x, x) for x in range(4)]
    paths, _ = run(messages)
    for count, path in enumerate(paths, 1):
        assert path.header == messages[count - 1].header
        np.testing.assert_array_equal(path.stamps_ns, [10**18 + n * 10**9 for n in range(count)])
        np.testing.assert_array_equal(path.positions_xyz, [[n, 2, 3] for n in range(count)])
        np.testing.assert_array_equal(path.quats_xyzw, [m.quat_xyzw for m in messages[:count]])


def test_what_was_published_stays_as_it_was():
    params = replace(EACH, max_poses=40)
    paths, _ = run([odometry(x, time_s=x) for x in range(500)], params)
    for last, path in enumerate(paths):
        expected = np.arange(max(0, last - 39), last + 1)
        np.testing.assert_array_equal(path.positions_xyz[:, 0], expected)
        np.testing.assert_array_equal(path.stamps_ns, 10**18 + expected * 10**9)


def test_a_pose_is_kept_when_it_is_far_enough_from_the_last_kept():
    messages = [odometry(n / 16, time_s=n) for n in range(33)]
    *_, path = published(messages, replace(EACH, min_distance=0.25, min_angle=180))
    np.testing.assert_array_equal(path.positions_xyz[:, 0], np.arange(0, 2.01, 0.25))


def test_or_when_it_is_turned_enough():
    messages = [odometry(0, 3 * n, n) for n in range(121)]  # once around
    *_, path = published(messages, replace(EACH, min_distance=1, min_angle=44.9))
    yaws = 2 * np.degrees(np.arctan2(path.quats_xyzw[:, 2], path.quats_xyzw[:, 3]))
    np.testing.assert_allclose(yaws, np.arange(0, 361, 45), atol=1e-9)


def test_the_two_quaternions_of_one_attitude_are_one():
    there = odometry(0, 30)
    same = replace(there, quat_xyzw=-there.quat_xyzw)
    *_, path = published([there, same], replace(EACH, min_distance=1, min_angle=0.001))
    assert len(path.stamps_ns) == 1


def test_an_attitude_that_is_none_is_no_turn():
    nothing = replace(odometry(), quat_xyzw=np.zeros(4))
    *_, path = published(
        [odometry(), nothing, odometry()], replace(EACH, min_distance=1, min_angle=5)
    )
    assert len(path.stamps_ns) == 1


def test_nothing_is_published_while_it_does_not_grow():
    params = PathParams(rate=0)
    paths, path = run([odometry(0, time_s=n) for n in range(50)], params)
    assert [answer is not None for answer in paths] == [True] + 49 * [False]
    assert path.finish() is None


@pytest.mark.parametrize(("rate", "count"), [(5, 50), (1, 10), (0, 1000), (100, 1000)])
def test_it_is_published_at_most_at_its_rate(rate, count):
    messages = [odometry(n, time_s=n / 100) for n in range(1000)]
    paths, path = run(messages, replace(EACH, rate=rate))
    assert sum(answer is not None for answer in paths) == count
    last = path.finish() or paths[-1]
    assert len(last.stamps_ns) == 1000


def test_after_a_rest_the_first_new_pose_is_published_at_once():
    messages = [odometry(0, time_s=n / 100) for n in range(500)] + [odometry(1, time_s=5.001)]
    paths, _ = run(messages, PathParams(rate=1))
    assert len(paths[-1].stamps_ns) == 2


def test_messages_without_stamps_go_by_the_time_of_arrival():
    class Clock:
        time_ns = 0

        def monotonic_ns(self):
            self.time_ns += 10_000_000
            return self.time_ns

    params = replace(EACH, rate=5)
    path = PathNode(params, Clock())
    unstamped = [replace(odometry(n), header=Header(0, "odom")) for n in range(1000)]
    assert sum(path.step(message, params) is not None for message in unstamped) == 50


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_and_counted(wrong):
    good, bad = odometry(1), odometry(wrong)
    turned = replace(good, quat_xyzw=np.array([0, 0, 0, wrong]))
    paths, path = run([bad, good, turned, bad])
    assert [answer is not None for answer in paths] == [False, True, False, False]
    assert path.report() == {"poses": 1, "refused": 3}


def test_another_frame_begins_a_new_path():
    paths, _ = run([odometry(1), odometry(2, time_s=1), odometry(3, time_s=2, frame="map")])
    assert paths[-1].header.frame_id == "map"
    np.testing.assert_array_equal(paths[-1].positions_xyz, [[3, 2, 3]])


@pytest.fixture
def runtime():
    graph = path_pipeline().configured({"path": vars(EACH)})
    runtime = LocalRuntime(graph, None)
    runtime.start()
    yield runtime
    runtime.stop()


def test_a_jump_back_in_time_begins_a_new_path(runtime):
    subscription = runtime.subscribe("/path")
    seen = []
    for number, (x, time_s) in enumerate([(0, 5), (1, 6), (2, 1), (3, 2)]):
        runtime.topic("/odom").publish(Packet(number, odometry(x, time_s=time_s), 0))
        seen.append(subscription.take(5).positions_xyz[:, 0].tolist())
    assert seen == [[0], [0, 1], [2], [2, 3]]


def test_a_path_is_recorded(runtime, tmp_path: File):
    subscription = runtime.subscribe("/path")
    recording = runtime.start_recording(tmp_path / "path.mcap")
    for number in range(3):
        runtime.topic("/odom").publish(Packet(number, odometry(number, time_s=number), 0))
        subscription.take(5)
    runtime.stop_recording(recording)
    with (tmp_path / "path.mcap").open("rb") as file:
        found = [(c.topic, s.name, m.data) for s, c, m in make_reader(file).iter_messages("/path")]
    assert [name for _, name, _ in found] == 3 * ["nav_msgs/msg/Path"]
    store = get_typestore(Stores.ROS2_JAZZY)
    paths = [from_message(store.deserialize_cdr(raw, name), Path) for _, name, raw in found]
    np.testing.assert_array_equal(paths[-1].positions_xyz[:, 0], [0, 1, 2])
    assert paths[-1].header == odometry(2, time_s=2).header


def test_a_husky_outdoors(recordings: File):
    """The kept poses are those of the odometry, as far apart as they should be."""
    with AnyReader([recordings / "bags" / "robot_localization_test1.bag"]) as bag:
        wanted = [c for c in bag.connections if c.topic == "/husky_velocity_controller/odom"]
        messages = [
            from_message(bag.deserialize(raw, c.msgtype), Odometry)
            for c, _, raw in bag.messages(wanted)
        ]
    assert len(messages) == 3952
    params = PathParams(min_distance=0.5, min_angle=180, rate=1)
    *_, path = published(messages, params)
    there = {m.header.stamp_ns: m.position_xyz.tolist() for m in messages}
    kept = dict(zip(path.stamps_ns.tolist(), path.positions_xyz.tolist(), strict=True))
    assert kept.items() <= there.items()
    steps = np.linalg.norm(np.diff([m.position_xyz for m in messages], axis=0), axis=1)
    gaps = np.linalg.norm(np.diff(path.positions_xyz, axis=0), axis=1)
    assert gaps.min() >= 0.5
    assert gaps.max() < 0.5 + steps.max()
