"""ULog files of any content: read as far as they can be, in bounded time and memory."""

import struct
import sys

import forked
import numpy as np
import pytest
from pyulog import ULog

from ros_visualise.core import limits
from ros_visualise.core.errors import OpenError
from ros_visualise.sources.logs.px4 import read_ulog
from ros_visualise.sources.logs.ulog_records import Records
from ros_visualise.sources.opening import open_recording

HEAD = b"ULog\x01\x125\x01" + bytes(8)
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"


def record(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


def described(text):
    return record("F", text.encode())


def added(number, name, instance=0):
    return record("A", struct.pack("<BH", instance, number) + name.encode())


def sample(number, stamp_us, *values):
    return record("D", struct.pack(f"<HQ{len(values)}f", number, stamp_us, *values))


FORMAT = described("gyro:uint64_t timestamp;float x;float[2] y;")
SAMPLES = [sample(3, 1000 * n, n, n + 0.5, -n) for n in range(50)]
LOG = HEAD + FORMAT + added(3, "gyro") + b"".join(SAMPLES)


def values(data, name="gyro"):
    [topic] = [one for one in Records(data).topics if one.name == name]
    return np.frombuffer(topic.samples, topic.dtype)


def test_every_topic_is_as_pyulog_reads_it(recordings):
    path = recordings / "trajectory" / "px4_ulog" / "sample_log_small.ulg"
    theirs, ours = ULog(str(path)), Records(path.read_bytes())
    topics = {(one.name, one.instance): one for one in ours.topics}
    assert len(topics) == len(theirs.data_list) == 70
    for one in theirs.data_list:
        topic = topics[one.name, one.multi_id]
        found = np.frombuffer(topic.samples, topic.dtype)
        assert list(found.dtype.names) == [field.field_name for field in one.field_data]
        for name, column in one.data.items():
            np.testing.assert_array_equal(found[name], column)
    assert ours.dropouts_ms == [30]
    assert (ours.damaged, ours.cut, ours.strangers) == (0, 0, 0)


def test_what_a_whole_log_holds():
    found = values(LOG)
    assert found["timestamp"].tolist() == [1000 * n for n in range(50)]
    assert found["y[1]"].tolist() == [-n for n in range(50)]
    assert not Records(LOG).damaged


@pytest.mark.parametrize("size", [0, 3, 40, 61, 100, 4000, 65535])
@pytest.mark.parametrize("kind", "ZDFAIS")
def test_a_short_file_of_any_sizes_ends(tmp_path, kind, size):
    """Of such a file other readers begin to read again and again."""
    path = tmp_path / "short.ulg"
    path.write_bytes(HEAD + struct.pack("<HB", size, ord(kind)) + bytes(97))
    with pytest.raises(OpenError, match=r"short\.ulg: "):
        open_recording(path)


def test_a_command_says_of_such_a_file_that_nothing_is_in_it(tmp_path):
    path = tmp_path / "short.ulg"
    path.write_bytes(HEAD + struct.pack("<HB", 61, ord("Z")) + bytes(97))
    command = [sys.executable, "-m", "ros_visualise", "info", path]
    done = forked.run(command, timeout=60)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("place", [7, 12, 30])
@pytest.mark.parametrize("junk", [b"\x00", b"\xff" * 7, bytes(9000), b"\x08\0S" + bytes(8)])
def test_reading_goes_on_after_damage(place, junk):
    log = HEAD + FORMAT + added(3, "gyro") + b"".join(SAMPLES[:place])
    data = log + junk + b"".join(SAMPLES[place:])
    assert values(data)["x"].tolist() == list(range(50))
    assert Records(data).damaged == len(junk)


def test_samples_of_a_topic_whose_record_is_missing_are_counted(tmp_path):
    data = HEAD + FORMAT + added(3, "gyro") + b"".join(SAMPLES) + sample(4, 0, 1.0) * 5
    found = Records(data)
    assert (found.strangers, found.damaged) == (5, 0)
    (tmp_path / "a.ulg").write_bytes(data)
    loss = read_ulog(tmp_path / "a.ulg", ["gyro"]).loss
    assert loss.messages == 5
    assert loss.notes == ["5 samples of topics without a description"]


def test_parts_that_were_appended_after_a_crash_are_read():
    log = HEAD + record("B", bytes(8) + b"\x01" + bytes(7) + bytes(24))
    log += FORMAT + added(3, "gyro") + b"".join(SAMPLES[:20]) + SAMPLES[20][:9]
    data = bytearray(log + b"".join(SAMPLES[30:]))
    struct.pack_into("<Q", data, 16 + 3 + 16, len(log))
    assert values(bytes(data))["x"].tolist() == [*range(20), *range(30, 50)]
    assert Records(bytes(data)).damaged == 0


@pytest.mark.parametrize(
    "formats",
    [
        ["a:a x;"],
        ["a:b x;", "b:a x;"],
        ["a:uint64_t timestamp;float[65535] x;"],
        ["a:uint64_t timestamp;b[60000] x;", "b:c[60000] x;", "c:uint8_t x;"],
        ["a:uint64_t timestamp;b[9] x;", "b:_padding0 x;"],
        ["a:uint64_t timestamp;float x;float x;"],
        ["a:float x;"],
        ["a:"],
    ],
)
def test_a_type_that_cannot_be_is_left_out(formats):
    log = HEAD + b"".join(map(described, formats)) + added(9, "a")
    data = log + FORMAT + added(3, "gyro") + b"".join(SAMPLES) + sample(9, 1, 2.0) * 3
    found = Records(data)
    assert [one.name for one in found.topics] == ["gyro"]
    assert values(data)["x"].tolist() == list(range(50))
    assert found.damaged + found.strangers > 0


def test_many_large_types_take_bounded_memory():
    """A kilobyte of descriptions and samples can stand for a million fields."""
    fields = "".join(f"uint8_t[60000] x{n};" for n in range(1))
    types = [described(f"t{n}:uint64_t timestamp;{fields}") for n in range(60)]
    topics = [added(n, f"t{n}") for n in range(60)]
    rows = [record("D", struct.pack("<HQ", n, n) + bytes(60000)) for n in range(60)]
    limits.set_max_memory(256 << 20)
    try:
        found = Records(HEAD + b"".join(types + topics + rows))
        names = sum(len(one.dtype.names) for one in found.topics)
    finally:
        limits.set_max_memory(limits.DEFAULT_MEMORY)
    assert names <= (256 << 20) // 256 // 4
    assert found.strangers > 0


def test_a_large_log_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large.ulg"
    with path.open("wb") as file:
        file.write(LOG)
        file.truncate(600 << 20)
    with pytest.raises(OpenError, match=r"a flight log of 600 MiB; .* add --max-memory 3G"):
        open_recording(path)


def test_garbage_of_every_kind_ends():
    rng = np.random.default_rng(5)
    for size in (1 << 16, 1 << 20):
        for kinds in (256, 84, 3):
            junk = rng.integers(0, kinds, size, np.uint8).tobytes()
            assert Records(LOG + junk).damaged + Records(LOG + junk).cut > 0


def test_a_file_of_damage_alone_is_given_up():
    data = LOG + (b"".join(SAMPLES[:3]) + b"Z") * 20_000
    found = Records(data)
    assert found.damaged > len(data) // 3
    assert len(values(data)) == 50 + 3 * 10_000
