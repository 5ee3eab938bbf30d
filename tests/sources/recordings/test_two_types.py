"""Topics on which messages of several types were recorded: one of them is read."""

from contextlib import closing
from pathlib import Path

import made_bags
import pytest
from made_bags import START_NS, BagWriter
from made_mcaps import ROS2, STRING, Written, text, write_bag
from mcap.writer import CompressionType, Writer

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.summary import summarize

VECTOR = "geometry_msgs/msg/Vector3"
LEFT_OUT = f"/x: 4 messages of {VECTOR} skipped: the topic has type {STRING}"


def bag(path: Path, *keys: str) -> None:
    """Five strings and four vectors in turns on one topic; ``keys``: connections in their order."""
    with BagWriter(path) as writer:
        for key in keys:
            writer.connect(key, "/x", {"string": STRING, "vector": VECTOR}[key])
        for number in range(9):
            if number % 2:
                message = made_bags.T[VECTOR](float(number), 0.0, 0.0)
                writer.write("vector", START_NS + number, message)
            else:
                message = made_bags.T[STRING](str(number))
                writer.write("string", START_NS + number, message)


def mcap(path: Path, *keys: str, chunk_size: int = 100) -> None:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=chunk_size, compression=CompressionType.NONE)
        writer.start("ros2")
        channels = {}
        for key in keys:
            name = {"string": STRING, "vector": VECTOR}[key]
            schema = writer.register_schema(
                name, "ros2msg", ROS2.generate_msgdef(name, ros_version=2)[0].encode()
            )
            channels[key] = writer.register_channel("/x", "cdr", schema, {})
        for number in range(9):
            stamp_ns = START_NS + number
            if number % 2:
                vector = bytes(ROS2.serialize_cdr(ROS2.types[VECTOR](number, 0.0, 0.0), VECTOR))
                writer.add_message(channels["vector"], stamp_ns, vector, stamp_ns)
            else:
                writer.add_message(channels["string"], stamp_ns, text(str(number)), stamp_ns)
        writer.finish()


def assert_reads_strings(recording: Recording) -> None:
    info = recording.topics["/x"]
    assert (info.type.name, info.messages, info.connections) == (STRING, 5, 2)
    for choice in (None, ["/x"]):
        entries = list(recording.read(topics=choice))
        assert [entry.stamp_ns - START_NS for entry in entries] == [0, 2, 4, 6, 8]
        assert [entry.message.content.text for entry in entries] == list("02468")
    assert (recording.stamps_ns()["/x"] - START_NS).tolist() == [0, 2, 4, 6, 8]
    assert (recording.loss.messages, recording.loss.notes) == (4, [LEFT_OUT])
    assert list(summarize(recording)["types"]) == [VECTOR, STRING]
    recording.close()


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_the_first_type_is_that_of_the_topic(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    (bag if suffix == ".bag" else mcap)(path, "string", "vector")
    assert_reads_strings(open_recording(path))


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
def test_of_the_second_type_there_is_more(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    (bag if suffix == ".bag" else mcap)(path, "vector", "string")
    recording = open_recording(path)
    assert recording.topics["/x"].type.name == VECTOR
    assert {entry.message.type_name for entry in recording.read()} == {VECTOR}
    assert recording.loss.messages == 5
    recording.close()


def test_a_type_that_cannot_be_read_does_not_hide_another(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with BagWriter(path) as writer:
        writer.connect("some", "/x", "some_msgs/msg/Some", msgdef="", md5sum="0" * 32)
        writer.connect("string", "/x", STRING)
        writer.write("some", START_NS, b"1234")
        writer.write("string", START_NS + 1, made_bags.T[STRING]("a"))
    recording = open_recording(path)
    assert (recording.topics["/x"].type.name, recording.topics["/x"].messages) == (STRING, 1)
    assert [entry.message.type_name for entry in recording.read()] == [STRING]
    assert recording.loss.messages == 1


def test_publishers_of_one_type_are_one_topic(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with BagWriter(path) as writer:
        writer.connect("one", "/x", STRING, callerid="/one")
        writer.connect("other", "/x", STRING, callerid="/other", msgdef="# words\nstring data\n")
        for number in range(6):
            writer.write(
                ("one", "other")[number % 2], START_NS + number, made_bags.T[STRING](str(number))
            )
    recording = open_recording(path)
    assert [entry.message.content.text for entry in recording.read()] == list("012345")
    assert not recording.loss


def test_parts_of_a_folder_may_differ(tmp_path: Path) -> None:
    strings = [Written("/x", START_NS + n, text(str(n))) for n in range(0, 9, 2)]
    vectors = [
        Written("/x", START_NS + n, bytes(ROS2.serialize_cdr(ROS2.types[VECTOR](n, 0, 0), VECTOR)))
        for n in range(1, 9, 2)
    ]
    write_bag(tmp_path / "a", strings)
    write_bag(tmp_path / "b", vectors, types={"/x": VECTOR})
    folder = tmp_path / "whole"
    folder.mkdir()
    (tmp_path / "a" / "a.db3").rename(folder / "whole_0.db3")
    (tmp_path / "b" / "b.db3").rename(folder / "whole_1.db3")
    recording = open_recording(folder)
    assert [entry.message.content.text for entry in recording.read()] == list("02468")
    assert recording.loss.notes == [LEFT_OUT]
    recording.close()


@pytest.mark.parametrize("suffix", [".bag", ".mcap", ""])
def test_nothing_is_written_under_another_type(tmp_path: Path, suffix: str) -> None:
    source = tmp_path / "in.bag"
    bag(source, "vector", "string")
    (message,) = [e.message for e in open_recording(source).read(START_NS, START_NS + 2)]
    target = tmp_path / f"out{suffix}"
    recorder = open_recorder(str(target), {"/x": TopicType(STRING)}, live=False)
    with recorder, pytest.raises(DamagedMessage, match=f"/x: {VECTOR} instead of {STRING}"):
        recorder.write("/x", message)
    with closing(open_recording(target)) as recording:
        assert recording.topics["/x"].messages == 0
