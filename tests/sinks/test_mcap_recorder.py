"""What is recorded to .mcap is what others read from it."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import RecordingError
from ros_visualise.data import ENCODINGS, Header, Image, ParameterEvent
from ros_visualise.messages import from_message
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import PARAMETER_EVENTS, open_recorder

IMAGE = TopicType("sensor_msgs/msg/Image")
TOPICS = {"/image_raw": IMAGE, "/edges": IMAGE}


def random_image(encoding: str, stamp_ns: int = 0, size: tuple[int, int] = (6, 7)) -> Image:
    dtype, channels = ENCODINGS[encoding]
    shape = size if channels == 1 else (*size, channels)
    pixels = np.random.default_rng(stamp_ns).integers(0, np.iinfo(dtype).max, shape, dtype)
    return Image(pixels, encoding, Header(stamp_ns, "cam"))


def record(path: Path, messages: list[tuple[str, Any]]) -> None:
    with open_recorder(str(path), TOPICS) as recorder:
        for topic, message in messages:
            recorder.write(topic, message)


def read(path: Path) -> list[tuple[str, int, str, Any]]:
    with AnyReader([path]) as reader:
        return [
            (c.topic, stamp_ns, c.msgtype, reader.deserialize(raw, c.msgtype))
            for c, stamp_ns, raw in reader.messages()
        ]


def whole_messages(path: Path) -> Iterator[Message]:
    with path.open("rb") as file:
        try:
            for found in StreamReader(file).records:
                if isinstance(found, Message):
                    yield found
        except (EndOfFile, struct.error):
            return


def test_rosbags_reads_every_encoding(tmp_path: Path) -> None:
    images = [random_image(e, 10**18 + i) for i, e in enumerate(ENCODINGS)]
    record(path := tmp_path / "r.mcap", [("/edges", image) for image in images])
    for image, (topic, stamp_ns, kind, message) in zip(images, read(path), strict=True):
        found = from_message(message, Image)
        assert (topic, kind) == ("/edges", "sensor_msgs/msg/Image")
        assert stamp_ns == image.header.stamp_ns
        assert (found.encoding, found.header) == (image.encoding, image.header)
        np.testing.assert_array_equal(found.pixels, image.pixels)


def test_parameter_events_are_recorded_beside_the_images(tmp_path: Path) -> None:
    event = ParameterEvent("edge_detector", changed={"low": 50}, header=Header(7))
    image = random_image("mono8", 7)
    record(path := tmp_path / "r.mcap", [(PARAMETER_EVENTS, event), ("/edges", image)])
    (topic, stamp_ns, kind, message), _ = read(path)
    assert (topic, stamp_ns) == (PARAMETER_EVENTS, 7)
    assert kind == "rcl_interfaces/msg/ParameterEvent"
    assert from_message(message, ParameterEvent) == event


def test_the_file_is_as_rosbag2_writes_it(tmp_path: Path) -> None:
    record(path := tmp_path / "r.mcap", [("/edges", random_image("mono8", s)) for s in (3, 5)])
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        found = list(reader.iter_messages())
        summary = reader.get_summary()
    assert [(m.log_time, m.publish_time, m.sequence) for _, _, m in found] == [(3, 3, 0), (5, 5, 0)]
    schema, channel, _ = found[0]
    assert schema is not None
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/Image", "ros2msg")
    assert b"\n" + b"=" * 80 + b"\nMSG: std_msgs/Header\n" in schema.data
    assert (channel.message_encoding, channel.metadata) == ("cdr", {"offered_qos_profiles": ""})
    assert summary is not None
    assert {c.topic for c in summary.channels.values()} == {*TOPICS, PARAMETER_EVENTS}


def test_the_same_messages_make_the_same_bytes(tmp_path: Path) -> None:
    messages = [("/edges", random_image("bgr8", stamp)) for stamp in range(5)]
    for name in ("a.mcap", "b.mcap"):
        record(tmp_path / name, messages)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


def test_an_unfinished_file_holds_all_that_was_written(tmp_path: Path) -> None:
    recorder = open_recorder(str(tmp_path / "r.mcap"), TOPICS)
    for count in range(3):
        recorder.write("/edges", random_image("mono8", count))
        (now := tmp_path / "now.mcap").write_bytes(recorder.path.read_bytes())
        assert [m.log_time for m in whole_messages(now)] == list(range(count + 1))
    recorder.close()


def test_a_file_cut_anywhere_holds_what_came_before(tmp_path: Path) -> None:
    images = [random_image("bgr8", s, (150, 150)) for s in range(3)]
    record(whole := tmp_path / "r.mcap", [("/edges", image) for image in images])
    data = whole.read_bytes()
    cut = tmp_path / "cut.mcap"
    counts = []
    for size in range(0, len(data), 997):
        cut.write_bytes(data[:size])
        counts.append(len(list(whole_messages(cut))) if size > 100 else 0)
    assert counts == sorted(counts)
    assert set(counts) == {0, 1, 2, 3}


def test_overwriting_leaves_nothing_of_the_old_file(tmp_path: Path) -> None:
    (path := tmp_path / "r.mcap").write_bytes(bytes(10**6))
    with open_recorder(str(path), TOPICS, overwrite=True) as recorder:
        recorder.write("/edges", random_image("mono8"))
    assert path.stat().st_size < 10**4
    assert len(read(path)) == 1


def test_topics_that_are_not_recorded_are_let_go(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "r.mcap", TOPICS, named=["/edges"]) as recorder:
        recorder.write("/image_raw", random_image("mono8"))
        recorder.write("/edges", random_image("mono8", 1))
    assert [topic for topic, *_ in read(recorder.path)] == ["/edges"]


def test_after_the_end_nothing_is_written(tmp_path: Path) -> None:
    record(path := tmp_path / "r.mcap", [])
    assert read(path) == []
    recorder = open_recorder(str(path), TOPICS, overwrite=True)
    recorder.close()
    recorder.close()
    with pytest.raises(RecordingError, match="has ended"):
        recorder.write("/edges", random_image("mono8"))
