"""ROS 1 bags are read whole, in order, from anywhere."""

import itertools
import threading

import made_bags
import numpy as np
import pytest
from made_bags import PERIOD_NS, START_NS, BagWriter, contents, drive

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.data import Image
from ros_visualise.sources.opening import open_recording

STRING = "std_msgs/msg/String"
REAL = [
    "evo_ROS_example",
    "evo_tf_example",
    "foxglove_example",
    "foxglove_example-lz4",
    "robot_localization_test1",
]


@pytest.fixture(params=["none", "lz4", "bz2"])
def compression(request):
    return request.param


@pytest.fixture
def bag(tmp_path):
    return tmp_path / "made.bag"


def text(value):
    return made_bags.T[STRING](value)


def in_order(written):
    return sorted(written, key=lambda message: message.stamp_ns)


def test_everything_that_was_written_comes_in_order(bag, compression):
    written = drive(bag, compression)
    recording = open_recording(bag)
    assert contents(recording) == in_order(written)
    assert len(made_bags.chunks(bag.read_bytes())) > 5
    assert not recording.loss


def test_it_says_what_it_holds(bag, compression):
    written = drive(bag, compression)
    recording = open_recording(bag)
    assert (recording.path, recording.format) == (bag, "rosbag 2.0")
    assert recording.size == bag.stat().st_size
    assert recording.compression == compression
    assert recording.start_ns == START_NS
    assert recording.end_ns == max(message.stamp_ns for message in written)
    found = {name: (topic.type.name, topic.messages) for name, topic in recording.topics.items()}
    assert list(found.items()) == [
        ("/cam/camera_info", ("sensor_msgs/msg/CameraInfo", 20)),
        ("/cam/image_raw", ("sensor_msgs/msg/Image", 20)),
        ("/imu", ("sensor_msgs/msg/Imu", 60)),
        ("/points", ("sensor_msgs/msg/PointCloud2", 20)),
    ]
    image = recording.topics["/cam/image_raw"]
    assert image.digest == "060021388200f6f0f447d0fcd9c64743"
    assert image.type.data_class is Image
    stamps = recording.stamps_ns()
    for topic in found:
        own = sorted(message.stamp_ns for message in written if message.topic == topic)
        assert stamps[topic].tolist() == own


def test_a_message_is_what_was_written(bag, compression):
    drive(bag, compression)
    image = next(e.message for e in open_recording(bag).read(topics=["/cam/image_raw"])).content
    assert (image.header.stamp_ns, image.header.frame_id) == (START_NS, "camera")
    assert image.data.shape == (24, 32, 3)
    assert image.data.ravel().tolist() == np.arange(24 * 32 * 3).astype(np.uint8).tolist()


@pytest.mark.parametrize("seed", range(6))
def test_any_order_of_recording_is_put_in_order(bag, compression, seed):
    """Chunks that overlap, and many equal stamps, which stay in the order of the file."""
    random = np.random.default_rng(seed)
    spread = [3, 30, 3000][seed % 3]
    with BagWriter(bag, compression, chunk_size=1000) as writer:
        for key in "abc":
            writer.connect(key, f"/{key}", STRING)
        for number in range(400):
            stamp_ns = START_NS + int(random.integers(0, spread) + number // 7)
            writer.write(str(random.choice(list("abc"))), stamp_ns, text(f"{number}"))
    recording = open_recording(bag)
    assert contents(recording) == in_order(writer.messages)
    middle_ns = START_NS + spread // 2
    later = [m for m in in_order(writer.messages) if m.stamp_ns >= middle_ns and m.topic != "/b"]
    assert contents(recording, middle_ns, topics={"/a", "/c"}) == later


def test_a_window_begins_and_ends_where_it_says(bag, compression):
    written = in_order(drive(bag, compression))
    recording = open_recording(bag)
    for start, stop in itertools.product([None, START_NS, START_NS + 3 * PERIOD_NS + 1], repeat=2):
        expected = [
            message
            for message in written
            if (start is None or message.stamp_ns >= start)
            and (stop is None or message.stamp_ns < stop)
        ]
        assert contents(recording, start, stop) == expected
    assert contents(recording, recording.end_ns + 1) == []
    assert contents(recording, topics=[]) == contents(recording, topics=["/other"]) == []


def test_reading_from_later_does_not_look_at_what_is_before(bag, compression):
    written = in_order(drive(bag, compression))
    data = bytearray(bag.read_bytes())
    for chunk in made_bags.chunks(data)[:-1]:
        data[chunk.data : chunk.end] = bytes(chunk.end - chunk.data)
    bag.write_bytes(data)
    recording = open_recording(bag)
    start_ns = recording.end_ns
    assert contents(recording, start_ns) == [m for m in written if m.stamp_ns >= start_ns]
    assert not recording.loss


def test_closing_ends_what_is_being_read(bag):
    drive(bag)
    recording = open_recording(bag)
    entries = recording.read()
    next(entries)
    closing = threading.Thread(target=recording.close)
    closing.start()
    closing.join()
    assert list(entries) == []


def test_an_empty_bag_has_nothing(bag):
    with BagWriter(bag):
        pass
    recording = open_recording(bag)
    assert (dict(recording.topics), contents(recording)) == ({}, [])
    assert (recording.start_ns, recording.end_ns, recording.compression) == (0, 0, "none")


def test_a_topic_of_two_publishers_is_one(bag):
    with BagWriter(bag) as writer:
        writer.connect("a", "/chatter", STRING, callerid="/a")
        writer.connect("b", "chatter", STRING, callerid="/b", latching=1)
        for number in range(10):
            writer.write("ab"[number % 2], START_NS + number, text(f"{number}"))
    recording = open_recording(bag)
    topic = recording.topics["/chatter"]
    assert (topic.messages, topic.connections, topic.type.qos.transient_local) == (10, 2, True)
    assert [e.message.message.data for e in recording.read()] == [f"{n}" for n in range(10)]


def test_of_publishers_that_disagree_the_first_counts(bag):
    """The message was changed between, and another type has the same topic."""
    with BagWriter(bag) as writer:
        writer.connect("old", "/x", "my/msg/A", msgdef="int32 value\n", md5sum="1" * 32)
        writer.connect("new", "/x", "my/msg/A", msgdef="float64 value\n", md5sum="2" * 32)
        writer.connect("text", "/x", STRING)
        writer.write("old", START_NS, b"\x07\0\0\0")
        writer.write("new", START_NS + 1, np.float64(0.5).tobytes())
        writer.write("text", START_NS + 2, text("hi"))
    recording = open_recording(bag)
    topic = recording.topics["/x"]
    assert (topic.type.name, topic.digest, topic.connections) == ("my/msg/A", "1" * 32, 3)
    assert [entry.message.message.value for entry in recording.read()] == [7]
    assert recording.loss.notes == [
        "/x: 1 message of my/msg/A skipped: the topic has a different type with the same name",
        f"/x: 1 message of {STRING} skipped: the topic has type my/msg/A",
    ]


NESTED = "Inner[] inner\nHeader header\n" + "=" * 80 + "\nMSG: my/Inner\nuint8 value\n"


@pytest.mark.parametrize(
    ("definition", "digest", "reason"),
    [
        ("int32 value\n!! no definition", "1" * 32, "my/msg/A: its definition cannot be read"),
        ("Missing value\n", "1" * 32, ""),
        ("", "1" * 32, "my/msg/A: unknown type"),
    ],
)
def test_what_is_not_defined_passes_as_bytes(bag, definition, digest, reason):
    with BagWriter(bag) as writer:
        writer.connect("a", "/a", "my/msg/A", msgdef=definition, md5sum=digest)
        writer.connect("b", "/b", STRING)
        writer.write("a", START_NS, b"\x07\0\0\0")
        writer.write("b", START_NS + 1, text("hi"))
    recording = open_recording(bag)
    assert contents(recording) == writer.messages
    unknown, known = (entry.message for entry in recording.read())
    with pytest.raises(DamagedMessage, match="my/msg/A"):
        unknown.message  # noqa: B018
    assert known.message.data == "hi"
    assert recording.topics["/a"].unreadable.startswith(reason)
    assert not recording.topics["/b"].unreadable


def test_own_types_are_read_as_the_bag_defines_them(bag):
    data = b"\x02\0\0\0\x05\x06" + STRING_HEADER
    with BagWriter(bag) as writer:
        writer.connect("a", "/a", "my/msg/A", msgdef=NESTED, md5sum="1" * 32)
        writer.connect("b", "/b", "my/msg/B", msgdef="", md5sum="d41d8cd98f00b204e9800998ecf8427e")
        writer.write("a", START_NS, data)
        writer.write("b", START_NS + 1, b"")
    recording = open_recording(bag)
    first, second = (entry.message.message for entry in recording.read())
    assert [inner.value for inner in first.inner] == [5, 6]
    assert first.header.frame_id == "map"
    assert type(second).__name__ == "my__msg__B"
    assert not recording.topics["/b"].unreadable


STRING_HEADER = b"\0\0\0\0" + b"\x01\0\0\0\x02\0\0\0" + b"\x03\0\0\0map"


def test_a_type_of_ros_without_its_definition_is_known_by_its_md5(bag):
    digests = {"/known": "992ce8a1687cec8c8bd883ec73ca41d1", "/other": "9" * 32}
    with BagWriter(bag) as writer:
        for topic, digest in digests.items():
            writer.connect(topic, topic, STRING, msgdef="", md5sum=digest)
            writer.write(topic, START_NS, text("hi"))
    topics = open_recording(bag).topics
    assert not topics["/known"].unreadable
    assert "not defined in the" in topics["/other"].unreadable


@pytest.mark.parametrize("name", REAL)
def test_real_bags_are_read_whole(recordings, name):
    path = recordings / "bags" / f"{name}.bag"
    recording = open_recording(path)
    entries = list(recording.read())
    found = [made_bags.Written(e.topic, e.stamp_ns, e.message.data) for e in entries]
    assert found == in_order(made_bags.by_definition(path.read_bytes()))
    assert not recording.loss
    assert not any(topic.unreadable for topic in recording.topics.values())
    decoded = {entry.topic: entry.message for entry in entries}
    assert decoded.keys() == recording.topics.keys()
    assert all(message.message is not None for message in decoded.values())
