"""What header, index and chunks of a ROS 1 bag say is held against one another."""

import json
import struct
import sys
from collections import Counter

import forked
import made_bags
import pytest
from made_bags import contents, drive, pieces, said
from rosbags.rosbag1 import Reader

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.summary import summarize

HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 3, 4, 5, 6, 7


@pytest.fixture(scope="module", params=["none", "lz4"])
def made(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "made.bag"
    return drive(path, request.param, steps=8), path.read_bytes()


def without(data, parts):
    """The bag without these pieces; nothing else is changed."""
    for part in sorted(parts, key=lambda part: -part.start):
        data = data[: part.start] + data[part.end :]
    return data


def chunk_with_index(data, number):
    """A chunk and the index records behind it."""
    found = pieces(data)
    at = [i for i, piece in enumerate(found) if piece.op == CHUNK][number]
    end = next(i for i in range(at + 1, len(found)) if found[i].op != INDEX)
    return found[at:end]


def opened(path, data):
    path.write_bytes(data)
    return open_recording(path)


def read_through(recording):
    """As info looks at it, and as it is played."""
    found = summarize(recording)
    return found, contents(recording)


@pytest.mark.parametrize("number", [0, 1, -1])
def test_a_chunk_that_is_missing_is_counted(made, tmp_path, number):
    written, data = made
    parts = chunk_with_index(data, number)
    lost = sum((piece.end - piece.data) // 12 for piece in parts if piece.op == INDEX)
    recording = opened(tmp_path / "a.bag", without(data, parts))
    found, there = read_through(recording)
    assert found["messages"] == len(there) == len(written) - lost
    assert recording.loss.messages == lost > 0
    assert f"its index lists {len(written)} messages; found {len(there)}" in recording.loss.notes


def test_an_only_chunk_that_is_missing_is_no_empty_bag(tmp_path):
    drive(tmp_path / "one.bag", steps=2, chunk_size=1 << 20)
    data = (tmp_path / "one.bag").read_bytes()
    with pytest.raises(OpenError, match=r"no readable messages.* lists 12 messages; found 0"):
        opened(tmp_path / "a.bag", without(data, chunk_with_index(data, 0)))


@pytest.mark.parametrize("op", [INDEX, CHUNK_INFO, CONNECTION])
def test_any_record_that_is_missing_is_a_difference(made, tmp_path, op):
    written, data = made
    for part in [piece for piece in pieces(data) if piece.op == op]:
        recording = opened(tmp_path / "a.bag", without(data, [part]))
        _, there = read_through(recording)
        recording.close()
        assert Counter(one.data for one in there) == Counter(one.data for one in written)
        assert recording.loss.messages == 0
        assert recording.loss.notes


@pytest.mark.parametrize("count", [-1, 1])
def test_a_count_that_differs_is_a_difference(made, tmp_path, count):
    written, data = made
    for part in [piece for piece in pieces(data) if piece.op == CHUNK_INFO]:
        (messages,) = struct.unpack_from("<I", data, part.data + 4)
        changed = bytearray(data)
        struct.pack_into("<I", changed, part.data + 4, messages + count)
        recording = opened(tmp_path / "a.bag", bytes(changed))
        _, there = read_through(recording)
        recording.close()
        assert there == written
        assert recording.loss.notes
        assert recording.loss.messages == max(0, count)


@pytest.mark.parametrize(("field", "years"), [(b"start_time=", -9), (b"end_time=", 9)])
def test_a_time_of_a_chunk_that_differs_is_a_difference(made, tmp_path, field, years):
    written, data = made
    part = [piece for piece in pieces(data) if piece.op == CHUNK_INFO][1]
    changed, at = bytearray(data), data.index(field, part.start) + len(field)
    (seconds,) = struct.unpack_from("<I", data, at)
    struct.pack_into("<I", changed, at, max(0, seconds + years * 31_000_000))
    recording = opened(tmp_path / "a.bag", bytes(changed))
    _, there = read_through(recording)
    recording.close()
    assert there == written
    assert recording.loss.notes
    assert recording.loss.messages == 0


@pytest.mark.parametrize("number", [0, 1, 2, -1])
def test_a_chunk_that_the_index_hides_is_a_difference(made, tmp_path, number):
    """The bag's index is whole in itself, and names one chunk less than there are."""
    _, data = made
    info = [piece for piece in pieces(data) if piece.op == CHUNK_INFO][number]
    place = data.index(b"chunk_count=") + len(b"chunk_count=")
    (chunks,) = struct.unpack_from("<I", data, place)
    changed = bytearray(data)
    struct.pack_into("<I", changed, place, chunks - 1)
    recording = opened(tmp_path / "a.bag", without(bytes(changed), [info]))
    assert summarize(recording)["lost"]["notes"]
    recording = open_recording(tmp_path / "a.bag")
    contents(recording)
    assert recording.loss.notes


def test_a_message_that_no_index_names_is_read_and_said(tmp_path):
    written = drive(tmp_path / "a.bag", steps=4, chunk_size=1 << 20)
    data = bytearray((tmp_path / "a.bag").read_bytes())
    index = next(p for p in pieces(data) if p.op == INDEX and p.end - p.data > 12)
    connection, entries = said(bytes(data), index)[b"conn"], (index.end - index.data) // 12
    info = next(piece for piece in pieces(data) if piece.op == CHUNK_INFO)
    place = data.index(connection, info.data)
    struct.pack_into("<I", data, place + 4, entries - 1)
    count = data.index(b"count=", index.start) + len(b"count=")
    struct.pack_into("<I", data, count, entries - 1)
    struct.pack_into("<I", data, index.data - 4, 12 * (entries - 1))
    shorter = bytes(data[: index.end - 12] + data[index.end :])
    place = shorter.index(b"index_pos=") + len(b"index_pos=")
    (position,) = struct.unpack_from("<Q", shorter, place)
    recording = opened(tmp_path / "b.bag", made_bags.set_index_position(shorter, position - 12))
    assert Counter(one.data for one in contents(recording)) == Counter(one.data for one in written)
    [note] = recording.loss.notes
    assert note == "at 0.0 MB: messages missing from its index"


@pytest.mark.parametrize(
    "name",
    ["evo_tf_example", "foxglove_example", "foxglove_example-lz4", "robot_localization_test1"],
)
def test_a_real_bag_is_whole(recordings, name):
    path = recordings / "bags" / f"{name}.bag"
    recording = open_recording(path)
    found, there = read_through(recording)
    with Reader(path) as reader:
        assert found["messages"] == len(there) == reader.message_count
    assert not recording.loss


def test_a_bag_without_messages_is_whole(tmp_path):
    with made_bags.BagWriter(tmp_path / "a.bag") as bag:
        bag.connect("imu", "/imu", "sensor_msgs/msg/Imu")
    recording = open_recording(tmp_path / "a.bag")
    assert read_through(recording)[1] == []
    assert not recording.loss


@pytest.mark.parametrize(
    "line",
    [
        ["info"],
        ["info", "--json"],
        ["bag", "--rate", "0", "--view", "none"],
        ["convert", "OUT"],
        ["trajectory", "--topic", "/odometry/filtered"],
    ],
    ids=lambda line: " ".join(line[:2]),
)
def test_all_commands_agree(recordings, tmp_path, line):
    data = (recordings / "bags" / "robot_localization_test1.bag").read_bytes()
    path = tmp_path / "a.bag"
    path.write_bytes(without(data, chunk_with_index(data, 1)))
    options = [str(tmp_path / "out.mcap") if part == "OUT" else part for part in line[1:]]
    if line[0] == "trajectory":
        options = []
    command = [sys.executable, "-m", "ros_visualise", line[0], str(path), *options]
    done = forked.run(command, timeout=300)
    assert done.returncode == 1, done.stderr
    counts = "its index lists 16806 messages; found 15045"
    if "--json" in line:
        assert json.loads(done.stdout)["lost"] == {"messages": 1761, "bytes": 0, "notes": [counts]}
    else:
        assert [part for part in (done.stdout + done.stderr).splitlines() if counts in part]
