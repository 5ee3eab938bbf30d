"""What recordings hold beside their messages, and of a message beside its bytes."""

from contextlib import closing
from pathlib import Path

import pytest
from made_mcaps import STRING, Written, latched_qos, numbered, text, write_bag
from mcap.records import Attachment, Metadata
from mcap.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2.metadata import parse_qos
from ruamel.yaml import YAML

from ros_visualise.sources.opening import open_recording

NOTES = Attachment(7, 5, "notes.txt", "text/plain", b"calm, sunny")
PICTURE = Attachment(8, 6, "site.png", "image/png", bytes(range(256)))
PLACE = Metadata("place", {"name": "north field", "marker": "7"})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """An MCAP file with attachments, metadata, and messages that were sent before they came."""
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(STRING, "ros2msg", b"string data")
        channel = writer.register_channel("/a", "cdr", schema)
        for extra in (NOTES, PICTURE):
            fields = (extra.create_time, extra.log_time, extra.name, extra.media_type, extra.data)
            writer.add_attachment(*fields)
        for number in range(5):
            stamp_ns = 1000 * number + 1000
            writer.add_message(channel, stamp_ns, text("x"), stamp_ns - 30, sequence=number + 40)
        writer.add_metadata(PLACE.name, PLACE.metadata)
        writer.finish()
    return path


def extras(path: Path) -> list[Attachment | Metadata]:
    with closing(open_recording(path)) as recording:
        return list(recording.extras())


def test_attachments_and_metadata_are_given(path: Path):
    assert extras(path) == [NOTES, PICTURE, PLACE]


def test_those_of_a_file_without_its_end_are_given(path: Path):
    path.write_bytes(path.read_bytes()[:-40])
    assert extras(path) == [NOTES, PICTURE, PLACE]


def test_a_damaged_one_is_said_and_the_others_are_given(path: Path):
    data = path.read_bytes()
    path.write_bytes(data.replace(b"calm, sunny", b"calm, stormy"[:11]))
    with closing(open_recording(path)) as recording:
        assert list(recording.extras()) == [PICTURE, PLACE]
        (note,) = recording.loss.notes
    assert "attachment" in note
    assert "checksum" in note


def test_messages_tell_when_they_were_sent_and_their_number(path: Path):
    with closing(open_recording(path)) as recording:
        found = [e.message for e in recording.read()]
    assert [m.publish_ns for m in found] == [1000 * n + 970 for n in range(5)]
    assert [m.sequence for m in found] == [40, 41, 42, 43, 44]


@pytest.mark.parametrize("storage", StoragePlugin)
def test_the_qos_of_publishers_is_given(tmp_path: Path, storage: StoragePlugin):
    write_bag(tmp_path / "bag", numbered(range(1, 7)), storage, latched=["/b"])
    with closing(open_recording(tmp_path / "bag")) as recording:
        offered = {name: topic.type.offered_qos for name, topic in recording.topics.items()}
    assert {name: parse_qos(text) for name, text in offered.items()} == {
        "/a": [],
        "/b": [latched_qos()],
        "/c": [],
    }


def test_what_somebody_added_to_a_bag_is_given(tmp_path: Path):
    write_bag(tmp_path / "bag", numbered(range(1, 7)))
    metadata = tmp_path / "bag" / "metadata.yaml"
    content = YAML(typ="safe").load(metadata.read_text())
    content["rosbag2_bagfile_information"]["custom_data"] = {"pilot": "Ada", "flight": 7}
    with metadata.open("w") as file:
        YAML(typ="safe").dump(content, file)
    assert extras(tmp_path / "bag") == [Metadata("custom_data", {"pilot": "Ada", "flight": "7"})]


def test_a_message_that_nobody_numbers_was_sent_when_it_was_recorded(tmp_path: Path):
    write_bag(tmp_path / "bag", [Written("/a", 12, text("x"))])
    with closing(open_recording(tmp_path / "bag")) as recording:
        (entry,) = recording.read()
        assert list(recording.extras()) == []
    assert (entry.message.publish_ns, entry.message.sequence) == (12, 0)
