"""The path: what of the odometry it keeps, and when it is published."""

import gc
import math
import sys
from dataclasses import replace
from pathlib import Path as File
from types import FunctionType, ModuleType

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from ros_visualise.data import (
    Header,
    NavSatFix,
    Odometry,
    Path,
    PoseStamped,
    PoseWithCovarianceStamped,
    Transforms,
    TransformStamped,
)
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.graph.pipelines import alone
from ros_visualise.messages import from_message
from ros_visualise.nodes import find_node
from ros_visualise.nodes.path import PathNode, PathParams
from ros_visualise.runtime.local import LocalRuntime

EACH = PathParams(min_distance=0, min_angle=0, rate=0)


class Stepped(PathNode):
    """Knows frames, as whatever runs a node has it know them."""

    def __init__(self, *given, **rest):
        self._frames = FrameTree()
        super().__init__(*given, **rest)

    def learn(self, message):
        self._frames.add(message, static=True)

    def step(self, params, tf=None, **rest):
        if tf is not None:
            self._frames.add(tf)
        return super().step(params, tf=tf, frames=self._frames, **rest)

    def reset(self):
        self._frames.reset()
        super().reset()


def odometry(x=0.0, yaw=0.0, time_s=0.0, frame="odom"):
    """At x metres, turned by yaw degrees."""
    half = math.radians(yaw) / 2
    quat = np.array([0, 0, math.sin(half), math.cos(half)])
    header = Header(round(time_s * 1e9) + 10**18, frame)
    return Odometry(np.array([x, 2.0, 3.0]), quat, header=header)


def run(messages, params=EACH):
    """The paths, and the node."""
    path = Stepped(params)
    return [path.step(params, odom=message) for message in messages], path


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
    node = Stepped(params)
    given = []
    for x in range(500):
        path = node.step(params, odom=odometry(x, time_s=x))
        given.append((path, path.stamps_ns.copy(), path.positions_xyz.copy()))
    for path, stamps_ns, positions_xyz in given:
        np.testing.assert_array_equal(path.stamps_ns, stamps_ns)
        np.testing.assert_array_equal(path.positions_xyz, positions_xyz)


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
    params = replace(EACH, rate=5)
    path = Stepped(params)
    unstamped = [replace(odometry(n), header=Header(0, "odom")) for n in range(1000)]
    answers = [
        path.step(params, odom=message, arrival_ns=10**12 + n * 10_000_000)
        for n, message in enumerate(unstamped)
    ]
    assert sum(answer is not None for answer in answers) == 50


class Watch:
    """A clock that a test sets."""

    time_ns = 0

    def monotonic_ns(self):
        return self.time_ns


def test_the_last_poses_are_published_when_none_has_come_for_a_period():
    params = replace(EACH, rate=5)
    node = Stepped(params, watch := Watch())
    for n in range(50):  # at 100 Hz: the last one is not due
        watch.time_ns = n * 10_000_000
        path = node.step(params, odom=odometry(n, time_s=n / 100))
        assert node.tick(params) is None
    assert path is None
    watch.time_ns += 199_999_999
    assert node.tick(params) is None
    watch.time_ns += 1
    assert len(node.tick(params).stamps_ns) == 50
    watch.time_ns += 10**9
    assert node.tick(params) is None  # it has not grown since
    assert node.finish() is None


def test_a_path_that_waits_is_published_though_other_messages_come():
    params = replace(EACH, rate=5)
    node = Stepped(params, watch := Watch())
    for n in range(2):
        node.step(params, odom=odometry(n, time_s=n / 100))
    watch.time_ns += 200_000_000
    assert node.step(params, tf=transforms(("map", "odom", 1, 5))) is None
    assert len(node.tick(params).stamps_ns) == 2


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused_and_counted(wrong):
    good, bad = odometry(1), odometry(wrong)
    turned = replace(good, quat_xyzw=np.array([0, 0, 0, wrong]))
    paths, path = run([bad, good, turned, bad])
    assert [answer is not None for answer in paths] == [False, True, False, False]
    assert path.report()["refused"] == 3
    assert path.report()["poses"] == 1
    assert path.report()["length_m"] == 0


def test_another_frame_begins_a_new_path_and_is_said_once(caplog):
    frames = ["odom", "odom", "map", "odom", "map"]
    paths, _ = run([odometry(i + 1, time_s=i, frame=one) for i, one in enumerate(frames)])
    assert paths[-1].header.frame_id == "map"
    np.testing.assert_array_equal(paths[-1].positions_xyz, [[5, 2, 3]])
    assert [line for line in caplog.messages if "frame changed from 'odom' to 'map'" in line]
    assert len(caplog.messages) == 1


def spiral(first, last, step_m):
    """Odometry at 50 Hz along a helix of 10 m radius."""
    for n in range(first, last):
        angle = n * step_m / 10
        xyz = np.array([10 * math.cos(angle), 10 * math.sin(angle), angle / 100])
        quat = np.array([0, 0, math.sin(angle / 2), math.cos(angle / 2)])
        yield Odometry(xyz, quat, header=Header(10**18 + n * 20_000_000, "odom"))


def test_the_number_of_poses_is_bounded_and_the_shape_kept():
    params = PathParams(max_poses=800, rate=0)
    node = Stepped(params)
    messages = list(spiral(0, 6000, step_m=0.1))
    for message in messages:
        path = node.step(params, odom=message)
        assert len(path.stamps_ns) <= 800
    report = node.report()
    assert 0 < report["deviation_m"] < 0.5
    line = path.positions_xyz
    for message in messages[::37]:  # each lies that near to the line between its neighbours
        at = np.searchsorted(path.stamps_ns, message.header.stamp_ns, "right") - 1
        a, b = line[at], line[min(at + 1, len(line) - 1)]
        along = b - a
        part = np.clip((message.position_xyz - a) @ along / max(along @ along, 1e-12), 0, 1)
        away = np.linalg.norm(message.position_xyz - a - part * along)
        assert away <= report["deviation_m"] + 1e-4


def bytes_held(root):
    """Bytes of all that an object holds, arrays that others made included."""
    seen, waiting, total = set(), [root], 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, (type, ModuleType, FunctionType)):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
    return total


def test_a_long_run_costs_what_a_short_one_does():
    """What is held and published in 10,000 messages, after 40,000 as after the first 10,000."""
    params = PathParams(max_poses=200)
    node = Stepped(params)
    held, published = [], []
    for start in range(0, 40_000, 10_000):
        messages = spiral(start, start + 10_000, step_m=0.02)
        paths = [node.step(params, odom=message) for message in messages]
        published.append(sum(path.nbytes for path in paths if path))
        del paths
        held.append(bytes_held(node))
    assert node.report()["length_m"] == pytest.approx(800, rel=0.01)
    assert max(held) < 60_000
    assert max(published) <= 1000 * 200 * 64  # 5 paths a second, 200 s, 64 bytes a pose


def test_it_says_how_far_and_how_fast():
    messages = [odometry(2 * n / 100, time_s=n / 100) for n in range(1001)]
    _, node = run(messages, PathParams())
    report = node.report()
    assert report["length_m"] == pytest.approx(20)
    assert report["duration_s"] == pytest.approx(10)
    assert report["mean_mps"] == report["top_mps"] == pytest.approx(2)
    assert report["deviation_m"] == 0


def test_a_cleared_path_begins_anew_where_it_is():
    paths, node = run([odometry(x, time_s=x) for x in range(5)])
    empty = node.clear()
    assert len(empty.stamps_ns) == 0
    assert empty.header == paths[-1].header
    assert node.report()["length_m"] == 0
    after = node.step(EACH, odom=odometry(7, time_s=7))
    np.testing.assert_array_equal(after.positions_xyz, [[7, 2, 3]])
    assert len(paths[-1].stamps_ns) == 5


def test_poses_with_and_without_covariance_are_followed():
    header = Header(10**18, "map")
    xyz, quat = np.array([1.0, 2, 3]), np.array([0, 0, 0, 1.0])
    for name, kind in (("pose", PoseStamped), ("pose_cov", PoseWithCovarianceStamped)):
        path = Stepped(EACH).step(EACH, **{name: kind(xyz, quat, header=header)})
        np.testing.assert_array_equal(path.positions_xyz, [[1, 2, 3]])
        assert path.header == header


def test_of_several_inputs_the_first_declared_is_followed():
    node = Stepped(EACH)
    pose = PoseStamped(np.zeros(3), np.array([0, 0, 0, 1.0]), Header(1, "map"))
    assert node.step(EACH, pose=pose).header.frame_id == "map"
    path = node.step(EACH, odom=odometry(1))
    assert path.header.frame_id == "odom"
    assert len(path.stamps_ns) == 1
    assert node.step(EACH, pose=replace(pose, position_xyz=np.ones(3))) is None
    assert len(node.step(EACH, odom=odometry(2, time_s=1)).stamps_ns) == 2


def fix(latitude, longitude, altitude=50.0, status=0, time_s=0.0):
    return NavSatFix(
        latitude, longitude, altitude, status=status, header=Header(round(time_s * 1e9), "gps")
    )


def test_fixes_are_put_on_the_plane_at_the_first():
    node = Stepped(EACH)
    fixes = [
        fix(48, 11, time_s=1),
        fix(48.001, 11, time_s=2, altitude=math.nan),
        fix(0, 0, status=-1, time_s=3),
        fix(math.nan, 11, time_s=4),
        fix(48, 11.001, time_s=5, altitude=60),
    ]
    answers = [node.step(EACH, fix=one) for one in fixes]
    path = [one for one in answers if one][-1]
    assert path.header == Header(5 * 10**9, "map")
    # A thousandth of a degree at 48 degrees north, on the WGS 84 ellipsoid.
    expected = [[0, 0, 0], [0, 111.2, 0], [74.63, 0, 10]]
    np.testing.assert_allclose(path.positions_xyz, expected, atol=0.06)
    np.testing.assert_array_equal(path.quats_xyzw, [[0, 0, 0, 1]] * 3)
    assert node.report()["refused"] == 2


def transforms(*several):
    """Of (parent, child, x, time in s)."""
    return Transforms(
        tuple(
            TransformStamped(
                child,
                np.array([x, 0.0, 0]),
                np.array([0, 0, 0, 1.0]),
                Header(round(time_s * 1e9), parent),
            )
            for parent, child, x, time_s in several
        )
    )


BY_TF = replace(EACH, tf_parent="map", tf_child="base_link")


def test_a_pair_of_frames_is_followed_through_the_tree():
    node = Stepped(BY_TF)
    node.learn(transforms(("base_footprint", "base_link", 0.5, 0)))
    node.step(BY_TF, tf=transforms(("map", "odom", 10, 1), ("odom", "base_footprint", 1, 1)))
    node.step(BY_TF, tf=transforms(("odom", "base_footprint", 2, 2)))
    node.step(BY_TF, tf=transforms(("odom", "base_footprint", 3, 3), ("odom", "other", 3, 2.7)))
    path = node.step(BY_TF, tf=transforms(("map", "odom", 20, 3)))
    np.testing.assert_array_equal(path.stamps_ns, [10**9, 2 * 10**9, 3 * 10**9])
    np.testing.assert_allclose(path.positions_xyz[:, 0], [11.5, 15 + 2.5, 23.5])
    assert path.header == Header(3 * 10**9, "map")
    assert node.step(BY_TF, odom=odometry(1)) is None


def test_static_frames_are_known_before_a_pair_is_asked_for():
    node = Stepped(EACH)
    node.learn(transforms(("odom", "base_link", 0.5, 0)))
    assert node.step(EACH, tf=transforms(("map", "odom", 1, 1))) is None
    path = node.step(BY_TF, tf=transforms(("map", "odom", 2, 2)))
    np.testing.assert_allclose(path.positions_xyz, [[2.5, 0, 0]])


def test_after_a_jump_back_in_time_the_pair_is_followed_on():
    node = Stepped(BY_TF)
    node.learn(transforms(("odom", "base_link", 0.5, 0)))
    for time_s in (100, 101):
        node.step(BY_TF, tf=transforms(("map", "odom", time_s, time_s)))
    node.reset()
    path = node.step(BY_TF, tf=transforms(("map", "odom", 1, 5)))
    np.testing.assert_allclose(path.positions_xyz, [[1.5, 0, 0]])


def test_transforms_that_are_none_are_left_out_and_counted(runtime):
    runtime.parameters["path"].update({"tf_parent": "map", "tf_child": "base_link"})
    subscription = runtime.subscribe("/path")
    runtime.publish("/tf", transforms(("map", "base_link", math.nan, 1)))
    runtime.publish("/tf", transforms(("map", "base_link", 1, 2)))
    np.testing.assert_array_equal(subscription.take(5).positions_xyz, [[1, 0, 0]])
    assert runtime.report().nodes["path"].dropped == {"wrong tf": 1}


@pytest.fixture
def runtime():
    graph = alone(find_node("path")).configured({"path": vars(EACH)})
    runtime = LocalRuntime(graph, None)
    runtime.start()
    yield runtime
    runtime.stop()


def test_a_jump_back_in_time_begins_a_new_path(runtime):
    subscription = runtime.subscribe("/path")
    seen = []
    for x, time_s in [(0, 5), (1, 6), (2, 1), (3, 2)]:
        runtime.publish("/odom", odometry(x, time_s=time_s))
        seen.append(subscription.take(5).positions_xyz[:, 0].tolist())
    assert seen == [[0], [0, 1], [2], [2, 3]]


def test_a_pose_that_comes_late_is_left_out_and_counted(runtime):
    subscription = runtime.subscribe("/path")
    for x, time_s in [(0, 5), (1, 6), (0.5, 5.5), (2, 7)]:
        runtime.publish("/odom", odometry(x, time_s=time_s))
        path = subscription.take(0.3 if time_s == 5.5 else 5)
        assert (path is None) == (time_s == 5.5)
    assert path.positions_xyz[:, 0].tolist() == [0, 1, 2]
    assert runtime.report().nodes["path"].own["refused"] == 1


def test_simulated_time_begins_at_0(runtime, caplog):
    subscription = runtime.subscribe("/path")
    for x in range(3):
        runtime.publish("/odom", odometry(x, time_s=x / 10))
        path = subscription.take(5)
    assert path.positions_xyz[:, 0].tolist() == [0, 1, 2]
    assert not caplog.messages


@pytest.mark.parametrize("frame", ["odom", ""])
@pytest.mark.parametrize("without", [0, 1, 2])
def test_a_pose_without_a_timestamp_costs_itself_alone_and_is_reported(
    runtime, caplog, without, frame
):
    subscription = runtime.subscribe("/path")
    for x in range(4):
        message = odometry(x, time_s=5 + x)
        if x == without:
            message = replace(message, header=Header(0, frame))
        runtime.publish("/odom", message)
        path = subscription.take(0.3 if 0 < x == without else 5)
        assert (path is None) == (0 < x == without)
    kept = [x for x in range(4) if x != without]
    assert path.positions_xyz[:, 0].tolist() == kept
    own = runtime.report().nodes["path"].own
    assert (own["refused"], own["duration_s"]) == (1, kept[-1] - kept[0])
    said = [line for line in caplog.messages if "without a timestamp" in line]
    assert len(said) == 1


def test_the_last_poses_are_published_though_no_message_follows(runtime):
    runtime.parameters["path"].update({"rate": 5.0})
    subscription = runtime.subscribe("/path", depth=10)
    for number in range(50):
        runtime.publish("/odom", odometry(number, time_s=number / 100))
    lengths = [0]
    while lengths[-1] < 50:
        lengths.append(len(subscription.take(60).stamps_ns))
    assert subscription.take(0) is None


def test_a_path_is_recorded(runtime, tmp_path: File):
    subscription = runtime.subscribe("/path")
    recording = runtime.start_recording(tmp_path / "path.mcap")
    for number in range(3):
        runtime.publish("/odom", odometry(number, time_s=number))
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


def test_it_is_said_once_that_another_input_is_followed_than_odometry(caplog):
    caplog.set_level("INFO", "ros_visualise")
    node = Stepped(PathParams())
    level = np.array([0.0, 0.0, 0.0, 1.0])
    for stamp_ns in (1, 2):
        node.step(PathParams(), pose=PoseStamped(np.zeros(3), level, Header(stamp_ns, "map")))
    assert caplog.messages == ["no odometry; drawing the path from the input pose"]
    node.step(PathParams(), odom=Odometry(np.zeros(3), level, header=Header(3, "odom")))
    assert len(caplog.messages) == 1
