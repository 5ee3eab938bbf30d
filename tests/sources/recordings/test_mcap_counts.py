"""What statistics, indexes and data of an MCAP file say is held against one another."""

import struct
import sys
import zlib
from collections import Counter

import forked
import made_mcaps
import pytest
from made_mcaps import CompressionType, in_order, numbered, parts, write_mcap, written
from mcap.opcode import Opcode
from mcap.writer import IndexType, Writer

from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.summary import summarize

MESSAGES = numbered(range(1000, 1060))
BEHIND = 29 + 8  # the footer and the magic


@pytest.fixture
def made(tmp_path):
    path = tmp_path / "a.mcap"

    def make(**options):
        write_mcap(path, MESSAGES, **options)
        return path, parts(path), path.read_bytes()

    return make


def sealed(content):
    """The file with a footer that fits to it."""
    footer = content[-BEHIND:]
    kind, length, start = struct.unpack_from("<BQQ", footer)
    head = struct.pack("<BQQQ", kind, length, start, 0)
    crc = zlib.crc32(content[start:-BEHIND] + head)
    return content[:-BEHIND] + head + struct.pack("<I", crc) + footer[-8:]


def read_twice(path):
    """What info says of it, and what is read of it; each of a recording that was just opened."""
    recording = open_recording(path)
    found = summarize(recording)
    recording.close()
    recording = open_recording(path)
    there = written(recording.read())
    return found, there, recording.loss


def assert_both_tell(path, lost=0):
    found, there, loss = read_twice(path)
    assert found["lost"]["notes"]
    assert loss.notes
    assert found["lost"]["messages"] == loss.messages == lost
    return there


WITH_CRC = [{"enable_crcs": False}, {"enable_crcs": True}]


@pytest.mark.parametrize("options", WITH_CRC)
@pytest.mark.parametrize("statistics", [True, False])
def test_a_chunk_that_is_missing_is_said(made, options, statistics):
    path, records, content = made(use_statistics=statistics, **options)
    chunks = [part for part in records if part.kind == Opcode.CHUNK]
    for chunk in chunks[:: len(chunks) // 3]:
        end = next(p.start for p in records if p.start >= chunk.end and p.kind != 7)
        path.write_bytes(content[: chunk.start] + content[end:])
        lost = len(chunk.stamps_ns) if statistics else 0
        there = assert_both_tell(path, lost)
        assert len(there) == len(MESSAGES) - len(chunk.stamps_ns)


@pytest.mark.parametrize("options", WITH_CRC)
@pytest.mark.parametrize("kind", [Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.DATA_END])
def test_a_record_of_an_index_that_is_missing_is_said(made, options, kind):
    path, records, content = made(**options)
    for part in [part for part in records if part.kind == kind][:3]:
        path.write_bytes(content[: part.start] + content[part.end :])
        assert assert_both_tell(path) == MESSAGES


def test_a_chunk_that_the_index_hides_is_said(made):
    """The summary is whole in itself, and names one chunk less than there are."""
    path, records, content = made(enable_crcs=False)
    chunks = [part for part in records if part.kind == Opcode.CHUNK]
    indexes = [part for part in records if part.kind == Opcode.CHUNK_INDEX]
    [statistics] = [part for part in records if part.kind == Opcode.STATISTICS]
    for number in (0, 1, len(chunks) - 1):
        hidden = Counter()
        recording = made_mcaps.in_order(MESSAGES)
        for stamp_ns in chunks[number].stamps_ns:
            [message] = [one for one in recording if one.stamp_ns == stamp_ns]
            hidden[message.topic] += 1
        changed = bytearray(content)
        count, schemas, channels, more, metadata, chunk_count = struct.unpack_from(
            "<QHIIII", changed, statistics.start + 9
        )
        count -= hidden.total()
        fields = (count, schemas, channels, more, metadata, chunk_count - 1)
        struct.pack_into("<QHIIII", changed, statistics.start + 9, *fields)
        place = statistics.start + 9 + 26 + 16 + 4
        for topic in sorted({one.topic for one in MESSAGES}):
            (there,) = struct.unpack_from("<Q", changed, place + 2)
            struct.pack_into("<Q", changed, place + 2, there - hidden[topic])
            place += 10
        part = indexes[number]
        path.write_bytes(sealed(bytes(changed[: part.start] + changed[part.end :])))
        assert_both_tell(path)


@pytest.mark.parametrize("at", [9, 9 + 26 + 16 + 4 + 2])
def test_statistics_of_other_messages_are_said(made, at):
    path, records, content = made(enable_crcs=False)
    [statistics] = [part for part in records if part.kind == Opcode.STATISTICS]
    changed = bytearray(content)
    changed[statistics.start + at] -= 1
    path.write_bytes(changed)
    assert assert_both_tell(path) == MESSAGES


def test_statistics_that_count_topics_differently_are_said(made):
    path, records, content = made(enable_crcs=False)
    [statistics] = [part for part in records if part.kind == Opcode.STATISTICS]
    changed, at = bytearray(content), statistics.start + 9 + 26 + 16 + 4 + 2
    changed[at] -= 1
    changed[at + 10] += 1
    path.write_bytes(changed)
    assert assert_both_tell(path) == MESSAGES


def test_a_summary_that_is_not_what_its_checksum_says_is_said(made):
    path, records, content = made(enable_crcs=True)
    [schema] = [part for part in records if part.kind == Opcode.SCHEMA]
    changed = bytearray(content)
    changed[schema.start + 12] ^= 1
    path.write_bytes(changed)
    assert assert_both_tell(path) == MESSAGES
    notes = open_recording(path).loss.notes
    assert notes == ["its index is damaged: checksum mismatch; all messages recovered without it"]


@pytest.mark.parametrize(
    "options",
    [
        {"index_types": IndexType.CHUNK},
        {"index_types": IndexType.NONE},
        {"use_statistics": False},
        {"use_statistics": False, "repeat_channels": False},
    ],
    ids=str,
)
def test_a_message_that_a_chunk_lacks_is_said(made, options):
    """Its kind is that of another record, so that only counts know of it."""
    path, _, content = made(enable_crcs=False, **options)
    changed = bytearray(content)
    changed[content.index(b"number 3 ") - 8 - 31] = 0x45
    path.write_bytes(changed)
    recording = open_recording(path)
    assert len(list(recording.read())) == len(MESSAGES) - 1
    assert (recording.loss.messages, len(recording.loss.notes)) == (1, 1)


@pytest.mark.parametrize("options", [{}, {"index_types": IndexType.CHUNK}], ids=str)
def test_a_time_outside_those_of_its_chunk_is_said(made, options):
    path, _, content = made(enable_crcs=False, **options)
    changed = bytearray(content)
    changed[content.index(b"number 30 ") - 8 - 16 + 4] = 1
    path.write_bytes(changed)
    recording = open_recording(path)
    assert len(list(recording.read())) == len(MESSAGES)
    [note] = recording.loss.notes
    assert note.endswith("has messages outside the time range of its index")


def write_extras(path):
    with path.open("wb") as file:
        writer = Writer(file, enable_crcs=False)
        writer.start("ros2")
        writer.add_attachment(1, 1, "a", "text/plain", b"first")
        writer.add_metadata("b", {"c": "d"})
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/a", "cdr", schema)
        writer.add_message(channel, 1, made_mcaps.text("x"), 1)
        writer.finish()


@pytest.mark.parametrize("kind", [Opcode.ATTACHMENT, Opcode.METADATA])
def test_an_attachment_or_metadata_that_is_missing_is_said(tmp_path, kind):
    path = tmp_path / "a.mcap"
    write_extras(path)
    assert read_twice(path)[2].notes == []
    [part] = [part for part in parts(path) if part.kind == kind]
    content = path.read_bytes()
    path.write_bytes(content[: part.start] + content[part.end :])
    assert len(assert_both_tell(path)) == 1


@pytest.mark.parametrize(
    "options",
    [
        *({"compression": one} for one in CompressionType),
        {"use_statistics": False},
        {"use_summary_offsets": False},
        {"repeat_channels": False},
        {"repeat_schemas": False},
        {"use_chunking": False},
        {"use_chunking": False, "use_statistics": False},
        {"enable_crcs": False},
        {"enable_data_crcs": True},
        *({"index_types": one} for one in (IndexType.NONE, IndexType.CHUNK, IndexType.MESSAGE)),
        {"index_types": IndexType.NONE, "use_statistics": False},
        {"index_types": IndexType.CHUNK, "use_statistics": False},
    ],
    ids=str,
)
def test_what_a_valid_writer_leaves_out_is_no_difference(made, options):
    path, _, _ = made(**options)
    found, there, loss = read_twice(path)
    assert there == in_order(MESSAGES)
    assert found["messages"] == len(MESSAGES)
    assert found["lost"]["notes"] == loss.notes == []


def test_a_file_without_messages_is_whole(tmp_path):
    write_mcap(tmp_path / "a.mcap", [])
    assert read_twice(tmp_path / "a.mcap")[2].notes == []


def test_statistics_may_count_only_all(made):
    """An empty map says that nobody counted by channel."""
    path, records, content = made(enable_crcs=False)
    [statistics] = [part for part in records if part.kind == Opcode.STATISTICS]
    body = content[statistics.start + 9 : statistics.start + 9 + 42]
    new = struct.pack("<BQ", Opcode.STATISTICS, 46) + body + struct.pack("<I", 0)
    path.write_bytes(sealed(content[: statistics.start] + new + content[statistics.end :]))
    assert read_twice(path)[2].notes == []


def test_all_commands_agree(made, tmp_path):
    path, records, content = made(enable_crcs=False)
    chunk = [part for part in records if part.kind == Opcode.CHUNK][1]
    path.write_bytes(content[: chunk.start] + content[chunk.end :])
    for line in (
        ["info", path],
        ["bag", path, "--rate", "0", "--view", "none"],
        ["convert", path, tmp_path / "out.bag", "--profile", "ros1"],
    ):
        command = [sys.executable, "-m", "ros_visualise", *map(str, line)]
        done = forked.run(command, timeout=200)
        assert done.returncode == 1, done.stderr
        assert "its statistics record lists 60 messages" in done.stdout + done.stderr
