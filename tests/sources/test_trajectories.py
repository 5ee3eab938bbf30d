"""Trajectories out of recordings: what is read, chosen, left out and put in order."""

import math
from pathlib import Path as File

import numpy as np
import pytest

from ros_visualise.core.errors import RosVisualiseError, UsageError
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
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded, TopicType
from ros_visualise.sources.recordings import Entry, TopicInfo
from ros_visualise.sources.trajectories import read_trajectory

S = 10**9
UPRIGHT = np.array([0, 0, 0, 1.0])


class Memory:
    """A recording of messages of one's own: topic -> messages, in the order of the topics."""

    def __init__(self, **topics):
        self.path = File("memory.bag")
        self._messages = {f"/{name}": messages for name, messages in topics.items()}
        self.topics = {
            name: TopicInfo(TopicType(messages[-1].type_name), len(messages))
            for name, messages in self._messages.items()
        }

    def read(self, start_ns=None, stop_ns=None, topics=None):
        for name in topics:
            for number, message in enumerate(self._messages[name]):
                yield Entry(name, 7 * S + number, message)


def header(time_s, frame="odom"):
    return Header(round(time_s * S), frame)


def pose(x, time_s, quat=UPRIGHT):
    return PoseStamped(np.array([x, 2.0, 3]), np.asarray(quat, float), header(time_s))


def transform(parent, child, x, time_s):
    return TransformStamped(child, np.array([x, 0.0, 0]), UPRIGHT, header(time_s, parent))


def moves(*transforms):
    return Transforms(tuple(transforms))


def x_of(found):
    return found.path.positions_xyz[:, 0].tolist()


QUAT = np.array([0.5, -0.5, 0.5, 0.5])


@pytest.mark.parametrize(
    "message",
    [
        Odometry(np.array([1.5, 2, 3]), QUAT, header=header(1.25)),
        PoseStamped(np.array([1.5, 2, 3]), QUAT, header(1.25)),
        PoseWithCovarianceStamped(np.array([1.5, 2, 3]), QUAT, header=header(1.25)),
        TransformStamped("base_link", np.array([1.5, 2, 3]), QUAT, header(1.25)),
        Path(
            np.array([1_250_000_000]),
            np.array([[1.5, 2, 3]]),
            QUAT[None],
            header(9),
        ),
    ],
    ids=lambda message: type(message).__name__,
)
def test_poses_of_every_type(message):
    found = read_trajectory(Memory(there=[message]))
    assert found.topic == "/there"
    assert found.path.header.frame_id == "odom"
    np.testing.assert_array_equal(found.path.stamps_ns, [1_250_000_000])
    np.testing.assert_array_equal(found.path.positions_xyz, [[1.5, 2, 3]])
    np.testing.assert_array_equal(found.path.quats_xyzw, [QUAT])


def test_of_paths_the_last_one():
    paths = [
        Path(np.arange(n) * S, np.ones((n, 3)) * n, np.tile(UPRIGHT, (n, 1)), header(n))
        for n in (2, 3)
    ]
    assert x_of(read_trajectory(Memory(path=paths))) == [3, 3, 3]


def test_fixes_on_the_plane_at_the_first_that_is_one():
    def fix(latitude, status=0, longitude=11.0):
        return NavSatFix(latitude, longitude, 500.0, status=status, header=header(1, "gps"))

    fixes = [fix(0.0, -1), fix(48.0), fix(48.001), fix(math.nan), fix(48.0, -1), fix(91.0)]
    found = read_trajectory(Memory(fix=fixes))
    assert found.skipped == {"without a fix": 2, "not finite": 2}
    assert found.path.header.frame_id == "map"
    np.testing.assert_array_equal(found.path.quats_xyzw, [UPRIGHT] * 2)
    np.testing.assert_allclose(found.path.positions_xyz, [[0, 0, 0], [0, 111.2, 0]], atol=0.06)


def test_what_is_no_number_is_left_out_and_counted():
    wrong = [pose(math.nan, 1), pose(math.inf, 2), pose(1e300, 2), pose(0, 3, [0, 0, 0, math.nan])]
    found = read_trajectory(Memory(pose=[pose(5, 0), *wrong]))
    assert x_of(found) == [5]
    assert found.skipped == {"not finite": 4}


def test_what_is_damaged_is_left_out_and_counted_and_said_once(caplog):
    damaged = Recorded("geometry_msgs/msg/PoseStamped", b"\1\2\3", Definitions("ros1"), 0)
    found = read_trajectory(Memory(pose=[pose(1, 0), damaged, damaged, pose(2, 1)]))
    assert x_of(found) == [1, 2]
    assert found.skipped == {"damaged": 2}
    assert caplog.messages == [
        "/pose: cannot decode 3 bytes as geometry_msgs/msg/PoseStamped"
        " (further occurrences suppressed)"
    ]


def test_poses_are_put_in_the_order_of_their_stamps():
    found = read_trajectory(Memory(pose=[pose(n, t) for n, t in enumerate((1, 2, 5, 3, 4, 5, 6))]))
    assert x_of(found) == [0, 1, 3, 4, 2, 5, 6]
    assert found.unordered == 2
    assert (np.diff(found.path.stamps_ns) >= 0).all()


def test_without_stamps_the_time_of_recording_counts():
    found = read_trajectory(Memory(pose=[pose(1, 0), pose(2, 0)]))
    assert found.path.stamps_ns.tolist() == [7 * S, 7 * S + 1]


def test_a_stamp_of_zero_among_others_is_one():
    found = read_trajectory(Memory(pose=[pose(1, 0), pose(2, 1)]))
    assert found.path.stamps_ns.tolist() == [0, S]


def test_a_quaternion_of_zeros_becomes_no_turn_and_is_counted():
    found = read_trajectory(Memory(pose=[pose(1, 0, np.zeros(4)), pose(2, 1, QUAT)]))
    np.testing.assert_array_equal(found.path.quats_xyzw, [UPRIGHT, QUAT])
    assert found.without_attitude == 1


def test_a_topic_may_be_named_without_its_slash():
    recording = Memory(a=[pose(1, 0)], b=[pose(2, 0)])
    assert x_of(read_trajectory(recording, "b")) == [2]
    assert x_of(read_trajectory(recording, "/b")) == [2]


def test_the_best_type_is_chosen():
    odometry = Odometry(np.array([8, 0, 0]), UPRIGHT, header=header(0))
    found = read_trajectory(Memory(a=[pose(1, 0)], b=[pose(2, 0)], c=[odometry]))
    assert found.topic == "/c"


@pytest.mark.parametrize(
    ("topic", "says"),
    [
        (None, "choose one: /a, /b"),
        ("/c", "no poses on /c; choose from /a, /b"),
        ("/tf", "no poses on /tf"),
        ("/tf:map", "/tf:PARENT.CHILD"),
        ("/tf:map.odom", "no poses on /tf"),
    ],
)
def test_what_cannot_be_chosen_is_said(topic, says):
    with pytest.raises(UsageError, match=says.replace(".", r"\.")):
        read_trajectory(Memory(a=[pose(1, 0)], b=[pose(2, 0)]), topic)


def test_nothing_to_choose_and_nothing_to_read_are_said():
    with pytest.raises(UsageError, match="no topic with poses"):
        read_trajectory(Memory())
    with pytest.raises(RosVisualiseError, match="no poses on /pose: 2 not finite"):
        read_trajectory(Memory(pose=[pose(math.nan, 0)] * 2))


TF = {
    "tf": [
        moves(transform("map", "odom", 10, 1), transform("odom", "base", 1, 1)),
        moves(transform("odom", "base", 2, 1.5), transform("base", "wheel", 9, 1.6)),
        moves(transform("odom", "base", 3, 2)),
        moves(transform("map", "odom", 20, 2), transform("odom", "base", 4, 3)),
    ],
    "tf_static": [moves(transform("base", "camera", 0.5, 0))],
}


def test_a_pair_of_frames_at_the_stamps_of_what_moves_between_them():
    found = read_trajectory(Memory(**TF), "/tf:map.camera")
    assert found.topic == "/tf:map.camera"
    assert found.path.header.frame_id == "map"
    np.testing.assert_array_equal(found.path.stamps_ns, np.array([1, 1.5, 2]) * S)
    np.testing.assert_allclose(x_of(found), [11.5, 17.5, 23.5])


def test_the_other_way_round_and_another_topic_of_static_transforms():
    recording = Memory(tf=TF["tf"], fixed=TF["tf_static"])
    found = read_trajectory(recording, "/tf:camera.odom:/fixed")
    np.testing.assert_allclose(x_of(found), [-1.5, -2.5, -3.5, -4.5])


def test_frames_that_are_not_there_are_said():
    with pytest.raises(
        UsageError, match=r"'nowhere'.*known frames: base, camera, map, odom, wheel"
    ):
        read_trajectory(Memory(**TF), "/tf:map.nowhere")
    with pytest.raises(UsageError, match="camera does not move relative to base"):
        read_trajectory(Memory(**TF), "/tf:base.camera")
    for topic in (None, "/tf"):
        with pytest.raises(UsageError, match=r"PARENT\.CHILD from base, camera, map, odom, wheel"):
            read_trajectory(Memory(**TF), topic)


def test_poses_of_the_same_stamp_are_counted():
    found = read_trajectory(Memory(pose=[pose(n, t) for n, t in enumerate((1, 1, 2, 3, 1))]))
    assert found.path.stamps_ns.tolist() == [S, S, S, 2 * S, 3 * S]
    assert found.repeated == 2
    assert read_trajectory(Memory(pose=[pose(1, 1), pose(2, 2)])).repeated == 0


def test_transforms_that_are_none_are_counted_by_what_is_wrong_with_them():
    def moved(parent, child, x=1.0, quat=UPRIGHT):
        position = np.array([x, 0, 0])
        return TransformStamped(child, position, np.asarray(quat, float), header(1, parent))

    wrong = [
        moved("odom", "odom"),
        moved("self", "self"),
        moved("base", "odom"),
        moved("", "nameless"),
        moved("odom", "flat", quat=[0, 0, 0, 0]),
        moved("odom", "nowhere", x=math.nan),
    ]
    found = read_trajectory(
        Memory(tf=[Transforms((moved("odom", "base"), *wrong))]), "/tf:odom.base"
    )
    assert x_of(found) == [1]
    assert found.skipped == {
        "transforms: is its own parent": 2,
        "transforms: would close a loop of frames": 1,
        "transforms: lacks a frame name": 1,
        "transforms: has a quaternion of zeros": 1,
        "transforms: holds a value that is not a number": 1,
    }
