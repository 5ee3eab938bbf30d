"""Messages whose type cannot be read keep their bytes and what the recording says of them."""

from contextlib import closing
from pathlib import Path

import pytest
from made_bags import START_NS, BagWriter
from made_mcaps import written
from mcap.reader import make_reader
from mcap.writer import Writer

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.schemas import Schemas

UNREADABLE = {
    "wstring words": r"my_msgs/msg/A: wide strings \(wstring\) are not supported",
    "!! no definition": "my_msgs/msg/A: its definition cannot be read",
    "": "my_msgs/msg/A: unknown type",
}


def made(path: Path, text: str, data: bytes) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("my_msgs/msg/A", "ros2msg", text.encode())
        channel = writer.register_channel("/a", "cdr", schema, {})
        for number in range(3):
            writer.add_message(channel, START_NS + number, data, START_NS + number)
        writer.finish()


@pytest.mark.parametrize("text", UNREADABLE)
def test_from_mcap_to_mcap_they_pass_unchanged(tmp_path: Path, text: str) -> None:
    source, target = tmp_path / "a.mcap", tmp_path / "b.mcap"
    made(source, text, b"\0\1\0\0some")
    with closing(open_recording(source)) as recording:
        info, entries = recording.topics["/a"], list(recording.read())
        assert [entry.message.data for entry in entries] == [b"\0\1\0\0some"] * 3
        assert entries[0].message.header.stamp_ns == START_NS
        with pytest.raises(DamagedMessage, match=UNREADABLE[text]):
            _ = entries[0].message.message
        with open_recorder(str(target), {"/a": info.type}, live=False) as recorder:
            for entry in entries:
                recorder.write(entry.topic, entry.message, entry.stamp_ns)
        wrong = tmp_path / "c.bag"
        with pytest.raises(DamagedMessage, match="my_msgs/msg/A: unknown type"):
            open_recorder(str(wrong), {"/a": info.type})
        assert not wrong.exists()
    with closing(open_recording(target)) as recording:
        assert written(recording.read()) == written(entries)
        assert recording.topics["/a"].unreadable
    with target.open("rb") as file:
        (schema,) = make_reader(file).get_summary().schemas.values()
    assert (schema.name, schema.data.decode()) == ("my_msgs/msg/A", text)


def test_within_ros1_a_bag_keeps_what_it_says_of_another_type_than_ros_has(tmp_path: Path) -> None:
    source, target = tmp_path / "a.bag", tmp_path / "b.bag"
    with BagWriter(source) as writer:
        writer.connect("a", "/a", "nav_msgs/msg/Odometry", msgdef="", md5sum="1" * 32)
        writer.write("a", START_NS, b"1234")
    recording = open_recording(source)
    with open_recorder(str(target), {"/a": recording.topics["/a"].type}, live=False) as recorder:
        for entry in recording.read():
            recorder.write(entry.topic, entry.message, entry.stamp_ns)
    copy = open_recording(target)
    assert (copy.topics["/a"].digest, copy.topics["/a"].type.name) == (
        "1" * 32,
        "nav_msgs/msg/Odometry",
    )
    assert copy.topics["/a"].unreadable
    assert [entry.message.data for entry in copy.read()] == [b"1234"]


@pytest.mark.parametrize(
    "constant", ['string<=5 NAME="a b"', "string NAME=", "string NAME=  ", "string<=2 NAME ="]
)
def test_constants_of_all_kinds_are_understood(constant: str) -> None:
    found = Schemas().define("cdr", "my_msgs/msg/A", f"{constant}\nstring<=9 name\nuint8 value\n")
    message = found.read("my_msgs/msg/A", b"\0\1\0\0\2\0\0\0a\0\7")
    assert (message.name, message.value) == ("a", 7)
