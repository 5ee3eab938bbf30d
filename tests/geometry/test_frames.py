"""The tree of frames against brute force, tf2's rules, and a real robot's recording."""

import threading

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Header, Transforms, TransformStamped
from ros_visualise.geometry.frames import MOST_FRAMES, FrameTree, WrongTransforms
from ros_visualise.geometry.rotations import from_rpy
from ros_visualise.geometry.se3 import from_pose, interpolate, inverse

S = 1_000_000_000
LEVEL = (0, 0, 0, 1)


def at(seconds, parent, child, xyz=(0, 0, 0), quat=LEVEL):
    return TransformStamped(
        child, np.array(xyz), np.array(quat), Header(round(seconds * S), parent)
    )


def moved(tree, target, source, seconds=None, **options):
    """The translation of a lookup."""
    stamp_ns = None if seconds is None else round(seconds * S)
    return tree.lookup(target, source, stamp_ns, **options)[:3, 3].tolist()


@pytest.fixture
def tree():
    return FrameTree()


def test_all_pairs_of_a_random_tree_are_products_along_it(tree):
    rng = np.random.default_rng(4)
    T_root = {"f0": np.eye(4)}
    for number in range(1, 30):
        parent, child = f"f{rng.integers(number)}", f"f{number}"
        xyz, quat = rng.normal(size=3), rng.normal(size=4)
        tree.add(at(1, parent, child, xyz, quat), static=bool(number % 2))
        T_root[child] = T_root[parent] @ from_pose(xyz, quat)
    for target, T_root_target in T_root.items():
        for source, T_root_source in T_root.items():
            expected = inverse(T_root_target) @ T_root_source
            np.testing.assert_allclose(tree.lookup(target, source, S), expected, atol=1e-12)
    assert tree.roots == ["f0"]
    assert tree.frames() == sorted(T_root)


def test_points_of_the_source_come_to_the_target(tree):
    """A sensor 1 m ahead on a robot that looks left: what is 2 m ahead of it is at (0, 3)."""
    tree.add(at(0, "map", "robot", quat=from_rpy([0, 0, np.pi / 2])))
    tree.add(at(0, "robot", "lidar", (1, 0, 0)), static=True)
    np.testing.assert_allclose(
        tree.lookup("map", "lidar", 0) @ [2, 0, 0, 1], [0, 3, 0, 1], atol=1e-12
    )


def test_between_samples_each_edge_is_interpolated_at_its_own_times(tree):
    rng = np.random.default_rng(8)
    edges = {("map", "odom"): [1, 4], ("odom", "base"): [0, 1.5, 2.25, 5]}
    poses = {}
    for (parent, child), times in edges.items():
        for time in times:
            xyz, quat = rng.normal(size=3), rng.normal(size=4)
            tree.add(at(time, parent, child, xyz, quat))
            poses[child, time] = from_pose(xyz, quat)
    for time in np.linspace(1, 4, 13):
        expected = np.eye(4)
        for (_, child), times in edges.items():
            start = max(t for t in times if t <= time)
            end = min(t for t in times if t >= time)
            part = (time - start) / (end - start) if end > start else 0.0
            expected = expected @ interpolate(poses[child, start], poses[child, end], part)
        np.testing.assert_allclose(tree.lookup("map", "base", round(time * S)), expected, atol=1e-9)


def test_turns_take_the_shortest_way_whatever_the_quaternions_signs(tree):
    tree.add(at(0, "map", "robot", quat=from_rpy([0, 0, 3.0])))
    tree.add(at(1, "map", "robot", quat=-from_rpy([0, 0, -3.0])))
    half = tree.lookup("map", "robot", S // 2)
    np.testing.assert_allclose(half[:2, :2], [[-1, 0], [0, -1]], atol=1e-12)


def test_outside_the_known_span_nothing_is_made_up(tree):
    tree.add(Transforms((at(1, "map", "robot", (1, 0, 0)), at(2, "map", "robot", (2, 0, 0)))))
    for seconds in (0.999999999, 2.000000001):
        with pytest.raises(
            NoTransform,
            match=r"from robot to map at .* s: robot is known from 1.000000000 to 2.000000000 s",
        ):
            moved(tree, "map", "robot", seconds)
    assert moved(tree, "map", "robot", 0.9, tolerance_s=0.2) == [1, 0, 0]
    assert moved(tree, "map", "robot", 2.1, tolerance_s=0.2) == [2, 0, 0]
    assert moved(tree, "robot", "map", 1e6, tolerance_s=float("inf")) == [-2, 0, 0]
    with pytest.raises(NoTransform):
        moved(tree, "map", "robot", 2.3, tolerance_s=0.2)


def test_the_newest_is_where_both_are_known(tree):
    for seconds in (1, 2, 3):
        tree.add(at(seconds, "map", "odom", (seconds, 0, 0)))
    for seconds in (1, 2):
        tree.add(at(seconds, "odom", "base", (0, seconds, 0)))
    tree.add(at(0, "base", "lidar", (0, 0, 1)), static=True)
    assert moved(tree, "map", "lidar") == [2, 2, 1]
    assert tree.newest_ns("map", "lidar") == tree.newest_ns("lidar", "map") == 2 * S
    assert tree.newest_ns("map", "odom") == 3 * S
    assert tree.newest_ns("base", "lidar") is None
    assert moved(tree, "base", "lidar") == [0, 0, 1]


def test_what_is_above_both_need_not_be_known(tree):
    tree.add(at(1, "map", "robot"))
    for side, y in (("left", 1), ("right", -1)):
        tree.add(at(9, "robot", side, (0, y, 0)))
    assert moved(tree, "left", "right", 9) == [0, -2, 0]


def test_a_frame_to_itself_is_the_identity_even_where_nothing_is_known(tree):
    np.testing.assert_array_equal(tree.lookup("lidar", "/lidar", 5), np.eye(4))


def test_static_ones_hold_at_all_times_and_the_last_one_counts(tree):
    tree.add(at(100, "base", "lidar", (1, 0, 0)), static=True)
    tree.add(at(50, "base", "lidar", (2, 0, 0)), static=True)
    assert moved(tree, "base", "lidar", 0) == moved(tree, "base", "lidar", 1e9) == [2, 0, 0]
    tree.add(at(7, "base", "lidar", (3, 0, 0)))
    assert moved(tree, "base", "lidar", 7) == [3, 0, 0]
    with pytest.raises(NoTransform):
        moved(tree, "base", "lidar", 8)


def test_out_of_order_is_as_in_order_and_a_second_of_one_time_replaces_the_first(tree):
    for seconds in (3, 1, 2, 0):
        tree.add(at(seconds, "map", "robot", (seconds, 0, 0)))
    assert moved(tree, "map", "robot", 0.25) == [0.25, 0, 0]
    assert moved(tree, "map", "robot") == [3, 0, 0]
    tree.add(at(2, "map", "robot", (7, 0, 0)))
    assert moved(tree, "map", "robot", 2) == [7, 0, 0]
    assert moved(tree, "map", "robot", 1.5) == [4, 0, 0]


def test_what_is_older_than_the_history_is_forgotten():
    tree = FrameTree(history_s=2)
    for seconds in range(6):
        tree.add(at(seconds, "map", "robot", (seconds, 0, 0)))
    assert moved(tree, "map", "robot", 3) == [3, 0, 0]
    with pytest.raises(NoTransform, match=r"known from 3\.0* to 5"):
        moved(tree, "map", "robot", 2.9)


@pytest.mark.parametrize("others", [(), (100, 100.1)])
@pytest.mark.parametrize("seconds", [5, 5000])
def test_a_wild_stamp_is_one_rejected_transform(tree, seconds, others):
    """tf2 ignores old ones too (TF_OLD_DATA); a jump of time is what the runtime resets for."""
    tree.add(at(0, "base", "lidar", (1, 0, 0)), static=True)
    for stamp in (100, 100.1, *others):
        tree.add(at(stamp, "map", "odom", (1, 0, 0)))
        tree.add(at(stamp, "odom", "base", (1, 0, 0)))
    for _ in range(2):
        with pytest.raises(WrongTransforms, match=r"'odom' -> 'base' is .* than 10 s") as caught:
            tree.add(at(seconds, "odom", "base", (2, 0, 0)))
        assert len(caught.value.wrong) == 1
        tree.add(at(100.2, "odom", "base", (1, 0, 0)))
    assert moved(tree, "map", "lidar", 100.1) == [3, 0, 0]
    assert tree.newest_ns("odom", "base") == round(100.2 * S)
    with pytest.raises(NoTransform):
        tree.lookup("odom", "base", seconds * S)


def test_a_burst_of_old_transforms_takes_nothing_away(tree):
    for stamp in (100, 101):
        tree.add(at(stamp, "map", "base", (1, 0, 0)))
    for stamp in range(5, 60):
        with pytest.raises(WrongTransforms):
            tree.add(at(stamp, "map", "base"))
    assert moved(tree, "map", "base", 100.5) == [1, 0, 0]


def test_a_gap_of_time_loses_no_transform(tree):
    """A frame that was still for an hour: its second transform shows that time went on."""
    tree.add(at(100, "map", "base"))
    with pytest.raises(WrongTransforms):
        tree.add(at(3700, "map", "base", (1, 0, 0)))
    tree.add(at(3730, "map", "base", (4, 0, 0)))
    tree.add(at(3731, "map", "base", (5, 0, 0)))
    assert moved(tree, "map", "base", 3730.5) == [4.5, 0, 0]


def test_another_frame_confirms_a_gap_of_time(tree):
    """A correction of map is sent rarely, odometry all the time."""
    tree.add(at(100, "map", "odom"))
    for seconds in range(100, 200):
        tree.add(at(seconds, "odom", "base"))
    tree.add(at(199, "map", "odom", (1, 0, 0)))
    assert moved(tree, "map", "base", 199) == [1, 0, 0]


def test_two_outvote_a_first_one_of_another_time(tree):
    tree.add(at(5000, "map", "base"))
    with pytest.raises(WrongTransforms):
        tree.add(at(5, "map", "base", (1, 0, 0)))
    tree.add(at(6, "map", "base", (2, 0, 0)))
    assert moved(tree, "map", "base", 5.5) == [1.5, 0, 0]


def test_after_a_reset_any_time_will_do(tree):
    tree.add(at(100, "map", "base"))
    tree.reset()
    tree.add(at(5, "map", "base", (1, 0, 0)))
    assert moved(tree, "map", "base", 5) == [1, 0, 0]


def test_reset_keeps_what_is_static(tree):
    tree.add(at(1, "map", "base"))
    tree.add(at(1, "base", "lidar", (1, 0, 0)), static=True)
    tree.reset()
    assert tree.frames() == ["base", "lidar"]
    assert moved(tree, "base", "lidar", 9) == [1, 0, 0]


def test_a_child_may_change_parents(tree):
    tree.add(at(0, "world", "shelf", (10, 0, 0)), static=True)
    tree.add(at(0, "world", "robot", (0, 5, 0)), static=True)
    tree.add(at(1, "shelf", "box", (0, 0, 1)))
    tree.add(at(2, "robot", "box", (0, 0, 2)))
    assert moved(tree, "world", "box", 1) == [10, 0, 1]
    assert moved(tree, "world", "box", 1.9) == [10, 0, 1]
    assert moved(tree, "world", "box", 2) == moved(tree, "world", "box") == [0, 5, 2]
    assert tree.parent("box") == "robot"


def test_names_may_begin_with_a_slash(tree):
    tree.add(at(0, "/map", "/robot", (1, 0, 0)), static=True)
    assert moved(tree, "/map", "robot", 0) == moved(tree, "map", "/robot", 0) == [1, 0, 0]
    assert tree.frames() == ["map", "robot"]
    assert (tree.parent("/robot"), tree.parent("map"), tree.parent("none")) == ("map", None, None)


def test_quaternions_are_normalised(tree):
    tree.add(at(0, "map", "robot", quat=(0, 0, 0.5, 0.5)), static=True)
    np.testing.assert_allclose(
        tree.lookup("map", "robot", 0) @ [1, 0, 0, 1], [0, 1, 0, 1], atol=1e-12
    )


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (at(0, "map", "robot", quat=(0, 0, 0, 0)), "'map' -> 'robot' has a quaternion of zeros"),
        (at(0, "map", "robot", quat=(0, 0, 0, np.nan)), "holds a value that is not a number"),
        (at(0, "map", "robot", (np.inf, 0, 0)), "holds a value that is not a number"),
        (at(0, "", "robot"), "lacks a frame name"),
        (at(0, "map", "/"), "lacks a frame name"),
        (at(0, "map", "/map"), "is its own parent"),
        (at(0, "lidar", "base"), "would close a loop of frames"),
    ],
)
@pytest.mark.parametrize("static", [False, True])
def test_what_is_no_transform_is_refused_and_the_others_are_kept(tree, wrong, why, static):
    tree.add(at(0, "base", "lidar"), static)
    with pytest.raises(ValueError, match=why):
        tree.add(Transforms((wrong, at(0, "map", "camera", (1, 0, 0)))), static)
    assert moved(tree, "map", "camera", 0) == [1, 0, 0]
    assert tree.frames() == ["base", "camera", "lidar", "map"]


def test_parents_that_swapped_out_of_order_end_in_words(tree):
    """Each newest sample is fine, and at an earlier time two frames hang below one another."""
    tree.add(at(1, "a", "b"))
    tree.add(at(3, "map", "b"))
    tree.add(at(1, "b", "a"))
    with pytest.raises(NoTransform):
        tree.lookup("map", "a", S)
    assert moved(tree, "map", "b", 3) == [0, 0, 0]


def test_errors_say_what_lacks(tree):
    with pytest.raises(NoTransform, match="from a to b: no transforms yet"):
        tree.lookup("b", "a", 0)
    tree.add(at(0, "map", "robot"))
    tree.add(at(0, "world", "lidar"), static=True)
    with pytest.raises(NoTransform, match="no frame 'gps'; known frames: lidar, map, robot, world"):
        tree.lookup("map", "gps")
    with pytest.raises(
        NoTransform,
        match="separate trees: lidar is below world, but robot is below map",
    ):
        tree.lookup("robot", "lidar")
    assert tree.roots == ["map", "world"]


def test_threads_may_write_and_read_at_once():
    tree = FrameTree(history_s=0.5)
    errors = []

    def write():
        for step in range(2000):
            tree.add(at(step / 1000, "map", "robot", (step, 0, 0)))

    def read():
        try:
            while writer.is_alive():
                if tree.frames():
                    assert moved(tree, "map", "robot")[0] >= 0
        except Exception as error:
            errors.append(error)

    writer = threading.Thread(target=write)
    readers = [threading.Thread(target=read) for _ in range(2)]
    for thread in (writer, *readers):
        thread.start()
    for thread in (writer, *readers):
        thread.join()
    assert errors == []
    assert moved(tree, "map", "robot") == [1999, 0, 0]


def test_a_robots_recording_is_read_as_it_was_sent(recordings):
    tree = FrameTree(history_s=100)
    sent = {}
    with AnyReader([recordings / "bags" / "evo_tf_example.bag"]) as reader:
        for connection, _, raw in reader.messages():
            for one in reader.deserialize(raw, connection.msgtype).transforms:
                xyz, quat = one.transform.translation, one.transform.rotation
                stamp = one.header.stamp
                message = TransformStamped(
                    one.child_frame_id,
                    np.array([xyz.x, xyz.y, xyz.z]),
                    np.array([quat.x, quat.y, quat.z, quat.w]),
                    Header(stamp.sec * S + stamp.nanosec, one.header.frame_id),
                )
                tree.add(message, static=connection.topic == "/tf_static")
                if connection.topic == "/tf":
                    sent[message.header.stamp_ns] = message
    assert len(sent) == 517
    assert tree.frames() == ["base_footprint", "base_link", "odom"]
    assert tree.roots == ["odom"]
    T_foot_base = tree.lookup("base_footprint", "base_link")
    for stamp_ns, message in sent.items():
        expected = from_pose(message.translation_xyz, message.quat_xyzw) @ T_foot_base
        found = tree.lookup("odom", "base_link", stamp_ns)
        np.testing.assert_allclose(found, expected, atol=1e-9)
    assert tree.newest_ns("odom", "base_link") == max(sent)


def test_names_without_end_are_refused_and_known_ones_go_on(tree):
    tree.add(Transforms(tuple(at(1, "map", f"frame{n}") for n in range(MOST_FRAMES))), True)
    with pytest.raises(WrongTransforms, match="exceeds the limit of 10000 frames"):
        tree.add(at(2, "map", "another"))
    tree.add(at(2, "map", "frame7", xyz=(7, 0, 0)), True)
    assert moved(tree, "map", "frame7")[0] == 7
    assert len(tree.frames()) == MOST_FRAMES + 1


def test_what_lags_behind_is_awaited_but_for_what_does_not_count(tree):
    tree.add(Transforms((at(1.0, "map", "odom"), at(1.2, "odom", "base_link"))))
    assert tree.is_awaited(round(1.2 * S), within_s=0.5)
    assert not tree.is_awaited(round(1.2 * S), within_s=0.5, but={"odom"})
    assert not tree.is_awaited(round(1.2 * S), within_s=0.1)
