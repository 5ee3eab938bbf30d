"""Recordings of a few kilobytes that stand for gigabytes: each is said, and the rest is read."""

import bz2
import re
import sqlite3
import struct
from contextlib import closing

import lz4.frame
import pytest
import zstandard
from made_bags import START_NS, BagWriter, chunks
from made_mcaps import STRING, Written, text, write_bag, write_mcap
from mcap.writer import CompressionType, Writer

from ros_visualise.core import limits
from ros_visualise.core.errors import DamagedMessage, OpenError
from ros_visualise.messages.definitions import Definitions
from ros_visualise.sources.logs.dji import open_srt
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.unpacking import DamagedData, unpack, unpack_all

MB = 1 << 20
PACK = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": zstandard.compress}
BOMB = "x" * (9 * MB)  # one of the least memory's 4 MB would be enough
LIMIT = r"unpacks to \d+ MiB or more; limit: 4 MiB; if you trust it, add --max-memory 1G"


@pytest.fixture(autouse=True)
def little_memory():
    limits.set_max_memory(64 * MB)
    yield
    limits.set_max_memory(limits.DEFAULT_MEMORY)


def read(path):
    """What there is, and what is said of the loss."""
    recording = open_recording(path)
    try:
        return [e.topic for e in recording.read()], "; ".join(recording.loss.notes)
    finally:
        recording.close()


@pytest.mark.parametrize("compression", PACK)
def test_no_more_is_unpacked_than_was_said(compression):
    packed = PACK[compression](bytes(8 * MB))
    with pytest.raises(DamagedData, match="does not have the declared size"):
        unpack(compression, packed, 1000)
    with pytest.raises(limits.TooLarge, match="8 MiB or more; limit: 4 MiB"):
        unpack(compression, packed, 8 * MB)
    with pytest.raises(limits.TooLarge, match="MiB or more; limit: 4 MiB"):
        unpack_all(compression, packed)
    limits.set_max_memory(128 * MB)
    assert unpack(compression, packed, 8 * MB) == unpack_all(compression, packed) == bytes(8 * MB)


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_a_chunk_of_a_bag_that_is_too_large_is_lost_alone(tmp_path, compression):
    path = tmp_path / "bomb.bag"
    with BagWriter(path, compression, chunk_size=1000) as bag:
        bag.connect("text", "/text", "std_msgs/msg/String")
        for number, size in enumerate((2000, 9 * MB, 2000)):
            message = struct.pack("<I", size) + b"x" * size
            bag.write("text", START_NS + number, message)
    assert len(chunks(path.read_bytes())) == 3

    found, notes = read(path)
    assert found == ["/text"] * 2
    assert re.search(LIMIT, notes)


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_of_an_mcap_that_is_too_large_is_lost_alone(tmp_path, compression):
    path = tmp_path / "bomb.mcap"
    sizes = (500, 9 * MB, 500)
    messages = [Written("/a", n, text("x" * size)) for n, size in enumerate(sizes)]
    write_mcap(path, messages, compression=compression)
    found, notes = read(path)
    assert found == ["/a"] * 2
    assert "limit: 4 MiB; if you trust it, add --max-memory 1G" in notes


def test_a_message_that_is_too_large_is_lost_alone(tmp_path):
    texts = [zstandard.compress(text(content)) for content in (BOMB, "fine")]
    write_bag(tmp_path / "bag", [Written("/a", n, data) for n, data in enumerate(texts)])
    metadata = tmp_path / "bag" / "metadata.yaml"
    content = metadata.read_text().replace("compression_mode: ''", "compression_mode: MESSAGE")
    metadata.write_text(content)
    found, notes = read(tmp_path / "bag")
    assert found == ["/a"]
    assert "/a: a message unpacks to 9 MiB or more; limit: 4 MiB" in notes


def test_where_nothing_is_left_the_reason_is_said(tmp_path):
    path = tmp_path / "bomb.mcap"
    write_mcap(path, [Written("/a", 1, text(BOMB))], compression=CompressionType.ZSTD)
    path.write_bytes(path.read_bytes()[:-200])  # so that its chunk has to be opened
    with pytest.raises(OpenError, match="limit: 4 MiB; if you trust it, add --max-memory 1G"):
        open_recording(path)


def test_packed_files_leave_the_disk_room(tmp_path, monkeypatch):
    write_bag(tmp_path / "bag", [Written("/a", 1, text("fine"))])
    [file] = (tmp_path / "bag").glob("*.db3")
    file.with_name(f"{file.name}.zstd").write_bytes(zstandard.compress(file.read_bytes()))
    file.unlink()
    monkeypatch.setattr(limits, "disk_reserve", lambda total: (total, "all of it"))
    with pytest.raises(OpenError, match=r"zstd: once unpacked, it needs .* is free; make room"):
        open_recording(tmp_path / "bag")


def test_of_a_packed_file_its_own_name_is_told(tmp_path):
    write_bag(tmp_path / "bag", [Written("/a", 1, text("fine"))])
    [file] = (tmp_path / "bag").glob("*.db3")
    packed = file.rename(file.with_name(f"{file.name}.zstd"))
    packed.write_bytes(zstandard.compress(bytes(9 * MB)))
    with pytest.raises(OpenError, match=re.escape(f"{packed}: unreadable ROS 2 bag")):
        open_recording(tmp_path / "bag")


MADE_OF = "=" * 80 + "\nMSG: "
DIAMOND = "".join(f"p/A{n} a\np/A{n} b\n{MADE_OF}p/A{n}\n" for n in range(40)) + "uint8 x"
DEEP = "".join(f"p/A{n} a\n{MADE_OF}p/A{n}\n" for n in range(99)) + "uint8 x"


@pytest.mark.parametrize(
    ("definition", "why"),
    [
        ("p/T a", "its definition contains itself"),
        ("p/T[] a", "its definition contains itself"),
        (f"p/A a\n{MADE_OF}p/A\np/B b\n{MADE_OF}p/B\np/A a", "its definition contains itself"),
        (DEEP, "nested more than 50 deep"),
        (DIAMOND, "more than 20000 fields"),
        ("string[100000000] a", "more than 20000 fields"),
        (f"p/A[100000000] a\n{MADE_OF}p/A\nuint8 x", "more than 20000 fields"),
        (
            "float64[4000000000] a",
            "each of its messages unpacks to 29.8 GiB or more; limit: 4 MiB",
        ),
        ("std_msgs/Empty[] a", "a sequence whose elements take no bytes"),
        (f"p/A[] a\n{MADE_OF}p/A\np/B[2] b\n{MADE_OF}p/B\n", "elements take no bytes"),
        ("".join(f"int32 a{n}\n" for n in range(30000)), "longer than 256 KiB"),
    ],
)
def test_a_type_without_an_end_is_said_and_the_rest_is_read(tmp_path, definition, why):
    path = tmp_path / "types.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for topic, name, schema in (("/t", "p/msg/T", definition), ("/ok", STRING, "string data")):
            number = writer.register_schema(name, "ros2msg", schema.encode())
            channel = writer.register_channel(topic, "cdr", number)
            writer.add_message(channel, 1, text("fine"), 1)
        writer.finish()
    with closing(open_recording(path)) as recording:
        assert why in recording.topics["/t"].unreadable
        [entry] = recording.read(topics=["/ok"])
        assert entry.message.content.text == "fine"


SMALL = f"uint8[] data\np/A[] a\n{MADE_OF}p/A\nuint8 x\n"


@pytest.mark.parametrize(
    ("definition", "one"), [(SMALL, b"x"), ("string[] a", b"\x00\x00\x00\x00")]
)
def test_a_message_becomes_only_so_many_objects(definition, one):
    definitions = Definitions("ros1")
    definitions.define("p/msg/T", definition)
    before = bytes(4) if definition == SMALL else b""
    data = before + struct.pack("<I", MB) + one * MB
    with pytest.raises(DamagedMessage, match=r"p/msg/T: a message of more than 262144 values"):
        definitions.read("p/msg/T", data)


def test_elements_that_another_type_empties_are_rejected():
    definitions = Definitions("ros1")
    definitions.define("p/msg/T", SMALL)
    definitions.define("p/msg/Other", f"p/A a\n{MADE_OF}p/A\n")
    with pytest.raises(DamagedMessage, match="a sequence whose elements take no bytes"):
        definitions.read("p/msg/T", bytes(4) + b"\xff" * 4)


def test_a_long_message_of_few_objects_is_read():
    definitions = Definitions("ros1")
    definitions.define("p/msg/T", SMALL)
    data = struct.pack("<I", MB) + bytes(MB) + struct.pack("<I", 2) + b"xy"
    message = definitions.read("p/msg/T", data)
    assert (len(message.data), [one.x for one in message.a]) == (MB, [120, 121])


def test_comments_and_blank_lines_cost_nothing():
    definitions = Definitions("cdr")
    definitions.define("p/msg/T", "\n" * MB + "# no\n" * MB + "int32 a\n")
    assert definitions.read("p/msg/T", b"\0\1\0\0\x07\0\0\0").a == 7


@pytest.mark.parametrize(
    "messages",
    [
        "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"
        " SELECT x AS id, 1 AS topic_id, x AS timestamp, zeroblob(9) AS data FROM c",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp,"
        " data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)",
    ],
    ids=["view", "generated"],
)
def test_computed_messages_are_none(tmp_path, messages):
    path = tmp_path / "bomb.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics(id, name, type, serialization_format)")
        database.execute(messages)
    with pytest.raises(OpenError, match="the table 'messages' or 'topics' is missing"):
        open_recording(path)


@pytest.mark.parametrize(
    "more", ["\n" * MB, "1" + "\n" * MB, "9" * MB + "\n", "2\n" + "9" * MB + ":00:01,000 -->"]
)
def test_subtitles_between_much_of_nothing(tmp_path, more):
    path = tmp_path / "film.srt"
    path.write_text("1\n00:00:01,000 --> 00:00:02,000\nGPS(10.0,20.0,3)\n\n" + more)
    recording = open_srt(path)
    assert recording.topics["/gps/fix"].messages == 1


def test_subtitles_that_are_too_many_are_refused(tmp_path):
    path = tmp_path / "film.srt"
    path.write_text("1\n00:00:01,000 --> 00:00:02,000\nGPS(10.0,20.0,3)\n\n" * 50_000)
    with pytest.raises(OpenError, match=r"film\.srt: a text of .*; limit: 2 MiB"):
        open_recording(path)
