"""Of a damaged ROS 1 bag, all is read that can be, and what is lost is said."""

import struct
from collections import Counter

import made_bags
import numpy as np
import pytest
from made_bags import BagWriter, chunks, contents, drive, message_counts, pieces, without_index
from seeds import runs

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.opening import open_recording

STEPS = 6
COMPRESSIONS = ["none", "lz4", "bz2"]


@pytest.fixture(scope="module", params=COMPRESSIONS)
def compression(request):
    return request.param


@pytest.fixture(scope="module")
def made(tmp_path_factory, compression):
    """The bytes of a bag, and its messages in the order of the file, which is that of time."""
    path = tmp_path_factory.mktemp("whole") / "made.bag"
    written = drive(path, compression, STEPS)
    return path.read_bytes(), written


@pytest.fixture
def reopen(tmp_path):
    def reopen(data):
        path = tmp_path / "damaged.bag"
        path.write_bytes(data)
        return open_recording(path)

    return reopen


def messages_of(made, number):
    """Those of one chunk, and the others."""
    data, written = made
    counts = message_counts(data)
    first = sum(counts[:number])
    stop = first + counts[number]
    return written[first:stop], written[:first] + written[stop:]


def overwrite(data, start, content):
    return data[:start] + content + data[start + len(content) :]


def assert_contradicted(recording):
    """All is there, but its parts do not say the same."""
    assert recording.loss.messages == 0
    assert len(recording.loss.notes) == 1


class TestCut:
    """Bags that end too early."""

    def test_all_before_the_cut_is_read(self, tmp_path):
        path = tmp_path / "whole.bag"
        written = talk(path)
        data = path.read_bytes()
        inner = [piece for c in chunks(data) for piece in pieces(data, c.data, c.end)]
        ends = [piece.end for piece in inner if piece.op == 2]
        assert len(ends) == len(written)
        index = index_position(data)
        for cut in cuts(data, inner):
            path.write_bytes(data[:cut])
            readable = sum(end <= cut for end in ends)
            if not readable:
                assert_refused(path, cut)
                continue
            recording = open_recording(path)
            assert contents(recording) == written[:readable], f"cut at {cut}"
            assert bool(recording.loss) == (cut < len(data)), f"cut at {cut}"
            assert recording.loss.bytes == max(0, index - cut) + torn(data, inner, cut)
            assert recording.loss.messages == 0

    @pytest.mark.parametrize("compression", ["lz4", "bz2"], indirect=True)
    def test_whole_chunks_before_the_cut_are_read(self, made, reopen):
        data, written = made
        ends = [piece.end for piece in chunks(data)]
        counts = message_counts(data)
        for cut in sorted({c + d for c in ends for d in (-1, 0, 1, 60)} | {ends[1] - 200}):
            whole = sum(count for count, end in zip(counts, ends, strict=True) if end <= cut)
            if not whole:
                continue
            recording = reopen(data[:cut])
            found = contents(recording)
            assert found == written[: len(found)], f"cut at {cut}"
            assert whole <= len(found), f"cut at {cut}"
            assert recording.loss, f"cut at {cut}"
            assert "cut off" in " ".join(recording.loss.notes)

    def test_a_compressed_chunk_is_read_up_to_the_cut(self, tmp_path):
        """Its first blocks can be decompressed before the rest is there."""
        path = tmp_path / "one.bag"
        written = drive(path, "lz4", steps=400, chunk_size=1 << 21)
        data = path.read_bytes()
        (chunk,) = chunks(data)
        path.write_bytes(data[: chunk.end - (chunk.end - chunk.data) // 3])
        recording = open_recording(path)
        found = contents(recording)
        assert len(written) // 3 < len(found) < len(written)
        assert found == written[: len(found)]
        assert recording.loss

    def test_nothing_before_the_first_message_is_no_recording(self, made, reopen):
        data, _ = made
        for cut in (9, 13, 14, 60, 4000, chunks(data)[0].data, chunks(data)[0].data + 10):
            with pytest.raises(OpenError, match="copy or record it again"):
                reopen(data[:cut])


def talk(path):
    """Words on two topics, four messages to a chunk; in order."""
    with BagWriter(path, chunk_size=300) as bag:
        for key in "ab":
            bag.connect(key, f"/{key}", "std_msgs/msg/String")
        for number in range(16):
            text = made_bags.T["std_msgs/msg/String"](f"{number}" * 20)
            bag.write("ab"[number % 3 == 0], made_bags.START_NS + number, text)
    assert len(chunks(path.read_bytes())) > 3
    return bag.messages


def cuts(data, inner):
    """At and around the boundaries of all records."""
    boundaries = {place for piece in [*pieces(data), *inner] for place in piece[1:]}
    around = {place + shift for place in boundaries for shift in (-1, 0, 1)}
    return sorted(cut for cut in around if 13 <= cut < len(data))


def index_position(data):
    place = data.index(b"index_pos=") + len(b"index_pos=")
    return struct.unpack_from("<Q", data, place)[0]


def torn(data, inner, cut):
    """Bytes before the cut of the record that it goes through."""
    outer = [piece for piece in pieces(data) if piece.op == 4]
    headers = [piece._replace(end=piece.data) for piece in chunks(data)]
    return sum(cut - p.start for p in inner + outer + headers if p.start < cut < p.end)


def assert_refused(path, cut):
    with pytest.raises(OpenError) as error:
        open_recording(path)
    assert str(path) in str(error.value), f"cut at {cut}"
    assert "\n" not in str(error.value)


class TestNeverClosed:
    """Bags whose recording was killed."""

    def test_all_is_there_without_the_index(self, made, reopen, compression):
        data, written = made
        recording = reopen(without_index(data))
        assert contents(recording) == written
        (note,) = recording.loss.notes
        assert note == f"never finished by its recorder; messages found: {len(written)}"
        assert (recording.loss.messages, recording.loss.bytes) == (0, 0)
        assert (recording.format, recording.compression) == ("rosbag 2.0, unindexed", compression)
        found = {name: topic.messages for name, topic in recording.topics.items()}
        assert found == Counter(message.topic for message in written)
        assert recording.start_ns == written[0].stamp_ns
        assert recording.end_ns == written[-1].stamp_ns
        assert sum(map(len, recording.stamps_ns().values())) == len(written)

    def test_it_can_be_sought(self, made, reopen):
        data, written = made
        recording = reopen(without_index(data))
        middle = written[len(written) // 2].stamp_ns
        expected = [m for m in written if m.stamp_ns >= middle and m.topic == "/imu"]
        assert contents(recording, middle, topics=["/imu"]) == expected

    def test_a_chunk_that_was_never_finished_is_read(self, made, reopen, compression):
        """While it is written, its lengths are zero; they are filled in at its end."""
        data, written = made
        chunk = chunks(data)[-1]
        keep = chunk.end - 40
        size = data.index(b"size=", chunk.start) + len(b"size=")
        unfinished = overwrite(without_index(data), chunk.data - 4, bytes(4))
        recording = reopen(overwrite(unfinished, size, bytes(4))[:keep])
        found = contents(recording)
        assert found == written[: len(found)]
        before = len(written) - message_counts(data)[-1]
        assert before <= len(found) < len(written)
        assert compression != "none" or len(found) == len(written) - 1
        assert recording.loss


class TestDamagedChunk:
    """What is damaged in the middle costs that chunk alone."""

    @pytest.mark.parametrize("number", [0, 2, -1])
    @pytest.mark.parametrize("compression", ["lz4", "bz2"], indirect=True)
    def test_content(self, made, reopen, number):
        data, _ = made
        number %= len(chunks(data))
        lost, others = messages_of(made, number)
        chunk = chunks(data)[number]
        damaged = overwrite(data, chunk.data + 8, bytes(chunk.end - chunk.data - 8))
        recording = reopen(damaged)
        assert not recording.loss
        for _ in range(2):
            assert contents(recording) == others
            assert recording.loss.messages == len(lost)
            assert len(recording.loss.notes) == 1

    @pytest.mark.parametrize("compression", ["lz4", "bz2"], indirect=True)
    def test_content_without_an_index(self, made, reopen):
        data, _ = made
        lost, others = messages_of(made, 2)
        chunk = chunks(data)[2]
        damaged = overwrite(data, chunk.data + 8, bytes(chunk.end - chunk.data - 8))
        recording = reopen(without_index(damaged))
        assert contents(recording) == others
        assert recording.loss.messages == len(lost)

    @pytest.mark.parametrize("number", [0, 2, -1])
    def test_header(self, made, reopen, number):
        data, _ = made
        number %= len(chunks(data))
        lost, others = messages_of(made, number)
        recording = reopen(overwrite(data, chunks(data)[number].start, b"\xff" * 12))
        assert contents(recording) == others
        assert recording.loss.messages == len(lost)

    def test_header_without_an_index(self, made, reopen):
        data, _ = made
        _, others = messages_of(made, 2)
        start, following = (chunk.start for chunk in chunks(data)[2:4])
        recording = reopen(overwrite(without_index(data), start, b"\xff" * 12))
        assert contents(recording) == others
        assert recording.loss.bytes == following - start

    def test_compression(self, made, reopen, compression):
        data, _ = made
        lost, others = messages_of(made, 2)
        place = data.index(b"compression=", chunks(data)[2].start) + len(b"compression=")
        recording = reopen(overwrite(data, place, b"xyz"))
        assert contents(recording) == others
        assert recording.loss.messages == len(lost)
        assert "unsupported compression" in recording.loss.notes[0]

    @pytest.mark.parametrize("compression", ["none"], indirect=True)
    @pytest.mark.parametrize("indexed", [True, False])
    def test_one_message(self, made, reopen, indexed):
        data, written = made
        chunk = chunks(data)[2]
        message = next(p for p in pieces(data, chunk.data, chunk.end) if p.op == 2)
        data = overwrite(data, message.start + 4, b"\xff" * 8)
        recording = reopen(data if indexed else without_index(data))
        first = len(written) - len(messages_of(made, 2)[0])
        assert len(contents(recording)) == len(written) - 1 >= first
        assert recording.loss.messages == 1

    def test_its_index(self, made, reopen):
        """Its messages are found by walking through it."""
        data, written = made
        index = next(piece for piece in pieces(data) if piece.op == 4)
        recording = reopen(overwrite(data, index.start, b"\xff" * 8))
        assert contents(recording) == written
        assert_contradicted(recording)

    def test_a_topic_that_its_count_in_the_index_does_not_name(self, made, reopen):
        data, written = made
        last = [piece for piece in pieces(data) if piece.op == 6][-1]
        damaged = overwrite(data, last.end - 8, struct.pack("<II", 0, 0))
        recording = reopen(damaged)
        assert contents(recording) == written
        assert_contradicted(recording)

    def test_a_count_in_its_index_with_more_behind_it(self, made, reopen):
        """An index does not count where the bag goes on behind it."""
        data, written = made
        recording = reopen(data[:-4] + struct.pack("<I", 9) * 30)
        assert sum(topic.messages for topic in recording.topics.values()) == len(written)
        assert contents(recording) == written

    @pytest.mark.parametrize("content", [b"\xff" * 12, bytes(12), struct.pack("<III", 1, 2, 3)])
    @pytest.mark.parametrize("is_closed", [True, False])
    def test_an_entry_of_its_index(self, made, reopen, content, is_closed):
        """Where it says nothing that can be, the chunk itself tells."""
        data, written = made
        index = [piece for piece in pieces(data) if piece.op == 4][-1]
        damaged = overwrite(data, index.data, content)
        recording = reopen(damaged if is_closed else without_index(damaged))
        found = contents(recording)
        assert Counter(m.data for m in found) == Counter(m.data for m in written)
        assert not is_closed or found == written
        assert_contradicted(recording)

    @pytest.mark.parametrize("stamp_bit", [0, 7, 33])
    def test_a_bit_of_a_stamp_in_its_index(self, made, reopen, stamp_bit):
        data, written = made
        index = [piece for piece in pieces(data) if piece.op == 4][3]
        (time,) = struct.unpack_from("<Q", data, index.data)
        damaged = overwrite(data, index.data, struct.pack("<Q", time ^ 1 << stamp_bit))
        recording = reopen(damaged)
        found = contents(recording)
        assert Counter(m.data for m in found) == Counter(m.data for m in written)
        assert_contradicted(recording)


class TestDamagedIndex:
    """Without an index that can be believed, the chunks are looked for."""

    @pytest.mark.parametrize("position", [0, 5, 4096 + 13, 5000, 1 << 40, (1 << 64) - 1])
    def test_pointing_elsewhere(self, made, reopen, position):
        data, written = made
        recording = reopen(made_bags.set_index_position(data, position))
        assert contents(recording) == written
        assert recording.loss.messages == 0
        assert recording.loss.notes == ["its index is damaged; all messages recovered without it"]

    def test_of_another_bag(self, made, reopen):
        """The chunks are 100 bytes further on than it says."""
        data, written = made
        end = chunks(data)[0].start
        filler = struct.pack("<I", 8) + b"\x04\0\0\0op=\x07" + struct.pack("<I", 84) + bytes(84)
        shifted = data[:end] + filler + data[end:]
        recording = reopen(made_bags.set_index_position(shifted, index_position(data) + 100))
        assert contents(recording) == written

    @pytest.mark.parametrize("op", [6, 7])
    def test_damaged(self, made, reopen, op):
        data, written = made
        for piece in pieces(data):
            if piece.op == op:
                recording = reopen(overwrite(data, piece.start + 4, b"\xff" * 8))
                assert contents(recording) == written

    def test_bag_header(self, made, reopen):
        data, written = made
        recording = reopen(overwrite(data, 13, b"\xff" * 100))
        assert contents(recording) == written


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "the file is empty"),
        (b"#ROSBAG V2.0\n" + b"\xff" * 5000, "no readable messages"),
        (b"#ROSBAG V2.0\n" + b"\x01\0\0\0" * 5000, "no readable messages"),
        (b"#ROSBAG V1.2\n" + bytes(100), "rosbag filter"),
        (b"#ROSBAG V3.0\n" + bytes(100), "unsupported bag version"),
        (b"no bag at all", "not a valid ROS 1 bag"),
    ],
)
def test_what_is_no_bag_is_refused_in_one_line(tmp_path, content, says):
    path = tmp_path / "some.bag"
    path.write_bytes(content)
    with pytest.raises(OpenError, match=says) as error:
        open_recording(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_an_encrypted_bag_is_refused(made, reopen):
    data, _ = made
    header = data[17 : 17 + struct.unpack_from("<I", data, 13)[0]]
    header += struct.pack("<I", 14) + b"encryptor=some"
    encrypted = data[:13] + struct.pack("<I", len(header)) + header + data[17 + len(header) - 18 :]
    with pytest.raises(OpenError, match="rosbag decrypt"):
        reopen(encrypted)


@pytest.mark.parametrize("seed", range(runs(14, of=40)))
def test_one_wrong_byte_costs_one_chunk_at_most(made, reopen, seed):
    data, written = made
    random = np.random.default_rng(seed)
    place = int(random.integers(13, len(data)))
    damaged = overwrite(data, place, bytes([data[place] ^ int(random.integers(1, 256))]))
    recording = reopen(damaged)
    found = Counter(message.data for message in contents(recording))
    intact = sum((found & Counter(message.data for message in written)).values())
    assert intact >= len(written) - max(message_counts(data))
    assert sum(found.values()) + recording.loss.messages >= len(written) or recording.loss.bytes


@pytest.mark.parametrize("seed", range(runs(20, of=60)))
def test_any_bytes_may_be_wrong(made, reopen, seed):
    data, _ = made
    random = np.random.default_rng(seed)
    damaged = data[: len(data) // 2] if seed % 6 == 0 else data
    for _ in range(random.choice([1, 3, 10, 50])):
        size = int(random.choice([1, 4, 8, 30, 100]))
        content = (b"\xff" * size, bytes(size), random.bytes(size))[random.integers(3)]
        damaged = overwrite(damaged, int(random.integers(13, len(damaged) - size)), content)
    try:
        recording = reopen(damaged)
    except OpenError as error:
        assert "no readable messages" in str(error)  # noqa: PT017
        return
    stamps = [message.stamp_ns for message in contents(recording)]
    assert stamps == sorted(stamps)
    assert list(recording.stamps_ns()) == list(recording.topics)
