"""MCAP files as they should be: content, order, topics, types."""

import random
import threading
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_mcaps import ROS1, ROS2, STRING, Written, in_order, numbered, write_mcap, written
from mcap.writer import CompressionType, IndexType, Writer

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.recordings.mcap_file import open_mcap

STYLES: list[dict[str, Any]] = [
    {"compression": CompressionType.NONE},
    {"compression": CompressionType.LZ4},
    {"compression": CompressionType.ZSTD},
    {"compression": CompressionType.LZ4, "chunk_size": 0},
    {"use_chunking": False},
    {"use_statistics": False},
    {"repeat_channels": False, "repeat_schemas": False},
    {"index_types": IndexType.CHUNK},
    {"index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False},
]


def shuffled(count: int, reach: int, seed: int) -> list[int]:
    """Stamps that go up on the whole, with equal ones among them."""
    chance = random.Random(seed)
    return [10**18 + 10 * (i // 2) + 10 * chance.randint(-reach, reach) for i in range(count)]


@pytest.mark.parametrize("style", STYLES, ids=str)
@pytest.mark.parametrize("reach", [0, 3, 100], ids="reach {}".format)
def test_all_messages_come_in_order_of_time_then_of_the_file(
    tmp_path: Path, style: dict[str, Any], reach: int
) -> None:
    messages = write_mcap(tmp_path / "a.mcap", numbered(shuffled(150, reach, 1)), **style)
    recording = open_mcap(tmp_path / "a.mcap")
    assert written(recording.read()) == in_order(messages)
    assert written(recording.read()) == in_order(messages)
    assert (recording.start_ns, recording.end_ns) == (
        min(m.stamp_ns for m in messages),
        max(m.stamp_ns for m in messages),
    )
    assert {t: info.messages for t, info in recording.topics.items()} == dict.fromkeys(
        ("/a", "/b", "/c"), 50
    )
    assert not recording.loss
    recording.close()


@pytest.mark.parametrize("style", STYLES, ids=str)
def test_a_window_of_some_topics_is_what_it_is_of_the_whole(
    tmp_path: Path, style: dict[str, Any]
) -> None:
    messages = write_mcap(tmp_path / "a.mcap", numbered(shuffled(120, 20, 2)), **style)
    recording = open_mcap(tmp_path / "a.mcap")
    stamps_ns = sorted({m.stamp_ns for m in messages})
    for first, last in ((0, 10), (10, 11), (20, -1), (30, 30)):
        start_ns, stop_ns = stamps_ns[first], stamps_ns[last]
        for topics in (None, ["/b"], {"/a", "/c", "/none"}, []):
            expected = [
                m
                for m in in_order(messages)
                if start_ns <= m.stamp_ns < stop_ns and (topics is None or m.topic in topics)
            ]
            assert written(recording.read(start_ns, stop_ns, topics)) == expected
    recording.close()


@pytest.mark.parametrize("style", STYLES, ids=str)
def test_stamps_are_those_of_the_messages(tmp_path: Path, style: dict[str, Any]) -> None:
    messages = write_mcap(tmp_path / "a.mcap", numbered(shuffled(100, 30, 3)), **style)
    recording = open_mcap(tmp_path / "a.mcap")
    for topic, stamps_ns in recording.stamps_ns().items():
        expected = sorted(m.stamp_ns for m in messages if m.topic == topic)
        np.testing.assert_array_equal(stamps_ns, expected)
    recording.close()


def test_a_file_says_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path, numbered([3, 4, 5]), compression=CompressionType.LZ4)
    recording = open_mcap(path)
    assert (recording.format, recording.compression) == ("mcap", "lz4")
    assert (recording.path, recording.size) == (path, path.stat().st_size)
    assert recording.topics["/a"].digest == ROS2.hash_rihs01(STRING)
    assert recording.topics["/a"].type.name == STRING
    recording.close()


def test_a_file_without_messages_is_empty(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", [])
    recording = open_mcap(tmp_path / "a.mcap")
    assert list(recording.read()) == []
    assert (recording.start_ns, recording.end_ns, dict(recording.topics)) == (0, 0, {})
    assert not recording.loss
    recording.close()


def test_ros_1_messages_are_read_as_such(tmp_path: Path) -> None:
    types = ROS1.types
    header = types["std_msgs/msg/Header"](
        seq=7, stamp=types["builtin_interfaces/msg/Time"](sec=5, nanosec=6), frame_id="base_link"
    )
    message = types["sensor_msgs/msg/TimeReference"](
        header=header, time_ref=header.stamp, source="x"
    )
    data = bytes(ROS1.serialize_ros1(message, "sensor_msgs/msg/TimeReference"))
    definition, md5 = ROS1.generate_msgdef("sensor_msgs/msg/TimeReference", ros_version=1)
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros1")
        schema = writer.register_schema("sensor_msgs/TimeReference", "ros1msg", definition.encode())
        plain = writer.register_channel("/time", "ros1", schema, {})
        kept = writer.register_channel("/kept", "ros1", schema, {"latching": "1", "md5sum": md5})
        writer.add_message(plain, 9, data, 9)
        writer.add_message(kept, 10, data, 10)
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    first, second = recording.read()
    assert first.message.header.frame_id == "base_link"
    assert first.message.header.stamp_ns == 5_000_000_006
    assert first.message.message.header.seq == 7
    assert (first.stamp_ns, second.topic) == (9, "/kept")
    topics = recording.topics
    assert [topics[t].type.qos.transient_local for t in ("/kept", "/time")] == [True, False]
    assert {info.digest for info in topics.values()} == {md5}
    assert topics["/time"].type.name == "sensor_msgs/msg/TimeReference"
    recording.close()


@pytest.mark.parametrize(
    ("profiles", "is_latched"),
    [
        ("- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n", True),
        ("- history: 1\n  depth: 1\n  reliability: 1\n  durability: 2\n", False),
        ("- history: keep_last\n  durability: transient_local\n", True),
        ("- history: keep_last\n  durability: volatile\n", False),
        ("", False),
    ],
)
def test_latched_topics_are_known_by_their_qos(
    tmp_path: Path, profiles: str, is_latched: bool
) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data")
        writer.register_channel("/map", "cdr", schema, {"offered_qos_profiles": profiles})
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    assert recording.topics["/map"].type.qos.transient_local is is_latched
    recording.close()


def test_what_is_not_ros_is_left_out_and_what_is_not_understood_named(tmp_path: Path) -> None:
    [string] = numbered([1], ["/string"])
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("")
        proto = writer.register_schema("foxglove.Log", "protobuf", b"\x00\x01")
        broken = writer.register_schema("my_msgs/msg/Broken", "ros2msg", b"}{ no definition")
        partial = writer.register_schema("my_msgs/msg/Partial", "ros2msg", b"my_msgs/Part part")
        good = writer.register_schema(STRING, "ros2msg", b"string data")
        channels = [
            writer.register_channel("/proto", "protobuf", proto, {}),
            writer.register_channel("/json", "json", 0, {}),
            writer.register_channel("/nameless", "cdr", 0, {}),
            writer.register_channel("/broken", "cdr", broken, {}),
            writer.register_channel("/partial", "cdr", partial, {}),
            writer.register_channel("/string", "cdr", good, {}),
        ]
        for channel in channels:
            writer.add_message(channel, 1, string.data, 1)
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    assert [(e.topic, e.message.data) for e in recording.read()] == [
        (topic, string.data) for topic in ("/broken", "/partial", "/string")
    ]
    unreadable = {topic: info.unreadable for topic, info in recording.topics.items()}
    assert unreadable.pop("/string") == ""
    assert unreadable == {
        "/proto": "protobuf: only ROS messages are supported",
        "/json": "json: only ROS messages are supported",
        "/nameless": "cdr: no schema",
        "/broken": "my_msgs/msg/Broken: its definition cannot be read",
        "/partial": "my_msgs/msg/Partial: has a field of the unknown type my_msgs/msg/Part",
    }
    assert [info.messages for info in recording.topics.values()] == [1] * 6
    recording.close()


def test_two_definitions_of_one_name_are_both_kept(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for number, field in enumerate(("uint8 small", "uint32 large")):
            schema = writer.register_schema("my_msgs/msg/Value", "ros2msg", field.encode())
            channel = writer.register_channel(f"/{number}", "cdr", schema, {})
            writer.add_message(channel, number, b"\x00\x01\x00\x00\x07\x00\x00\x00", number)
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    first, second = recording.read()
    assert (first.message.message.small, second.message.message.large) == (7, 7)
    assert not recording.loss
    recording.close()


def test_idl_definitions_are_understood(tmp_path: Path) -> None:
    idl = "=" * 80 + '\nIDL: my_msgs/msg/Pair\n#include "std_msgs/msg/Header.idl"\n'
    idl += "module my_msgs { module msg { struct Pair {\n"
    idl += "  int32 left; sequence<double> right; }; }; };\n"
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("my_msgs/msg/Pair", "ros2idl", idl.encode())
        channel = writer.register_channel("/pair", "cdr", schema, {})
        writer.add_message(channel, 1, b"\x00\x01\x00\x00" + bytes([5, 0, 0, 0] + [0] * 4), 1)
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    [entry] = recording.read()
    assert entry.message.message.left == 5
    assert len(entry.message.message.right) == 0
    recording.close()


def test_images_have_the_calibration_of_their_camera(tmp_path: Path) -> None:
    types = ROS2.types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=1), frame_id="cam"
    )
    pixels = np.arange(6, dtype=np.uint8)
    image = types["sensor_msgs/msg/Image"](
        header=header, height=2, width=3, encoding="mono8", is_bigendian=0, step=3, data=pixels
    )
    region = types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    camera = np.array([5.0, 0, 1, 0, 6, 1, 0, 0, 1])
    info = types["sensor_msgs/msg/CameraInfo"](
        header=header,
        height=2,
        width=3,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=camera,
        r=np.eye(3).ravel(),
        p=np.zeros(12),
        binning_x=0,
        binning_y=0,
        roi=region,
    )
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for topic, message in (("/cam/image_raw", image), ("/cam/camera_info", info)):
            name = message.__msgtype__
            definition = ROS2.generate_msgdef(name, ros_version=2)[0].encode()
            channel = writer.register_channel(
                topic, "cdr", writer.register_schema(name, "ros2msg", definition), {}
            )
            writer.add_message(channel, 1, bytes(ROS2.serialize_cdr(message, name)), 1)
        writer.finish()
    recording = open_mcap(tmp_path / "a.mcap")
    [entry] = recording.read(topics=["/cam/image_raw"])
    content = entry.message.content
    np.testing.assert_array_equal(content.pixels, pixels.reshape(2, 3))
    np.testing.assert_array_equal(content.camera_info.K, camera.reshape(3, 3))
    recording.close()


def test_chunks_far_apart_are_not_held_together(tmp_path: Path) -> None:
    """At most one piece is loaded at a time where chunks do not overlap."""
    write_mcap(tmp_path / "a.mcap", numbered(range(1000, 1300)))
    recording = open_mcap(tmp_path / "a.mcap")
    storage = recording._storages[0]  # type: ignore[attr-defined]
    spans = list(zip(storage.starts_ns, storage.ends_ns, strict=True))
    assert len(spans) > 20
    assert all(before[1] < after[0] for before, after in pairwise(spans))
    loaded: list[int] = []
    load = storage._load
    storage._load = lambda piece: loaded.append(piece) or load(piece)
    for entry in recording.read():
        assert loaded[-1] == sum(start <= entry.stamp_ns for start, _ in spans) - 1
    recording.close()


def test_closing_from_another_thread_ends_reading(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", numbered(range(1000)))
    recording = open_mcap(tmp_path / "a.mcap")
    entries = recording.read()
    first = next(entries)
    closer = threading.Thread(target=recording.close)
    closer.start()
    closer.join()
    assert first.stamp_ns == 0
    assert list(entries) == []
    assert list(recording.read()) == []
    recording.close()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b"hello", "not an MCAP file"),
        (b"\x89MCAP1\r\n", "not an MCAP file"),
    ],
)
def test_what_is_no_mcap_is_said_in_a_line(tmp_path: Path, content: bytes, words: str) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(OpenError, match=words) as caught:
        open_mcap(tmp_path / "a.mcap")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_said_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(OpenError, match="No such file"):
        open_mcap(tmp_path / "none.mcap")


def test_messages_may_be_empty(tmp_path: Path) -> None:
    messages = write_mcap(tmp_path / "a.mcap", [Written("/a", 5, b""), Written("/a", 6, b"")])
    recording = open_mcap(tmp_path / "a.mcap")
    assert written(recording.read()) == messages
    recording.close()
