"""ROS 2 bags whose files are cut off or damaged."""

import random
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from made_mcaps import Written, numbered, parts, text, write_bag, written
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

PAGE_BYTES = 4096


def made(
    folder: Path, sizes: tuple[int, ...] = (20, 500, 9000), count: int = 400
) -> tuple[list[Written], Path]:
    """A bag with messages of no zeros, of up to some pages each."""
    chance = random.Random(1)
    messages = [
        Written("/a", 1000 + i, bytes(chance.choices(range(1, 256), k=chance.choice(sizes))))
        for i in range(count)
    ]
    write_bag(folder, messages)
    return messages, folder / f"{folder.name}.db3"


@pytest.mark.parametrize(
    ("sizes", "count"), [((20, 500, 9000), 400), ((100, 200), 3000), ((20_000, 30_000), 40)]
)
def test_of_a_cut_database_what_is_there_is_read(
    tmp_path: Path, sizes: tuple[int, ...], count: int
) -> None:
    messages, file = made(tmp_path / "bag", sizes, count)
    content = file.read_bytes()
    counts = []
    for tenth in (3, 4, 5, 6, 7, 8, 9):
        file.write_bytes(content[: len(content) * tenth // 10 + tenth])
        recording = open_rosbag2(tmp_path / "bag")
        found = written(recording.read())
        assert set(found) <= set(messages)
        assert found == sorted(found, key=lambda message: message.stamp_ns)
        assert len(found) + recording.loss.messages == len(messages)
        assert "cut off or damaged" in " ".join(recording.loss.notes)
        counts.append(len(found))
        recording.close()
    assert 0 < counts[0] < counts[2] < counts[4] < counts[6]


def test_a_damaged_page_costs_its_own_messages(tmp_path: Path) -> None:
    messages, file = made(tmp_path / "bag")
    content = bytearray(file.read_bytes())
    database = sqlite3.connect(file)
    [(root,)] = database.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'")
    database.close()
    kinds = content[PAGE_BYTES::PAGE_BYTES]
    leaves = [i for i, kind in enumerate(kinds, 2) if kind == 13 and i != root]
    page = leaves[len(leaves) // 2]
    content[(page - 1) * PAGE_BYTES : page * PAGE_BYTES] = b"\xff" * PAGE_BYTES
    file.write_bytes(content)
    recording = open_rosbag2(tmp_path / "bag")
    found = written(recording.read())
    assert set(found) < set(messages)
    assert len(found) > len(messages) * 0.8
    assert (found[0], found[-1]) == (messages[0], messages[-1])
    assert len(found) + recording.loss.messages == len(messages)
    recording.close()


@pytest.mark.parametrize("at", [3, 5, 40, 700, 1500, 3000, 3900, 4093, 4095])
def test_a_damaged_index_costs_no_message(tmp_path: Path, at: int) -> None:
    """One wrong byte of each of its pages, which may also hide what follows in it."""
    messages, file = made(tmp_path / "bag")
    content = bytearray(file.read_bytes())
    for start in range(PAGE_BYTES, len(content), PAGE_BYTES):
        if content[start] == 10:  # a leaf of an index
            content[start + at] ^= 0x5A
    file.write_bytes(content)
    recording = open_rosbag2(tmp_path / "bag")
    assert written(recording.read()) == messages
    recording.close()


def test_any_bytes_of_a_database_may_be_wrong(tmp_path: Path) -> None:
    _, file = made(tmp_path / "bag")
    content = file.read_bytes()
    chance = random.Random(2)
    opened = 0
    for _ in range(30):
        damaged = bytearray(content)
        for _ in range(chance.randint(1, 20)):
            damaged[chance.randrange(100, len(damaged))] = chance.randrange(256)
        file.write_bytes(damaged)
        try:
            recording = open_rosbag2(tmp_path / "bag")
        except OpenError:
            continue
        stamps_ns = [entry.stamp_ns for entry in recording.read()]
        assert stamps_ns == sorted(stamps_ns)
        recording.stamps_ns()
        recording.close()
        opened += 1
    assert opened > 10


def test_any_bytes_of_its_schema_may_be_wrong(tmp_path: Path) -> None:
    """SQLite then says so in words that are no text, or asks for more memory than there is."""
    file = tmp_path / "a.db3"
    write_bag(tmp_path / "bag", numbered(range(60)))
    content = (tmp_path / "bag" / "bag.db3").read_bytes()
    opened = 0
    for seed in range(80):
        chance = random.Random(seed)
        damaged = bytearray(content)
        for _ in range(chance.choice([1, 3, 10])):
            place, size = chance.randrange(16, 3 * PAGE_BYTES), chance.choice([1, 4, 8])
            damaged[place : place + size] = chance.choice([b"\xff" * size, chance.randbytes(size)])
        file.write_bytes(damaged)
        try:
            recording = open_recording(file)
        except OpenError:
            continue
        stamps_ns = [entry.stamp_ns for entry in recording.read()]
        assert stamps_ns == sorted(stamps_ns)
        recording.stamps_ns()
        recording.close()
        opened += 1
    assert opened > 40


@pytest.mark.parametrize("place", ["CREATE TABLE messages", "timestamp_idx"])
def test_a_part_whose_schema_is_no_text_does_not_stop_the_others(
    tmp_path: Path, place: str
) -> None:
    write_bag(tmp_path / "bag", numbered(range(20)))
    content = (tmp_path / "bag" / "bag.db3").read_bytes()
    damaged = content.replace(place.encode(), b"\xf4\xff" + place[2:].encode())
    (tmp_path / "bag" / "bag_1.db3").write_bytes(damaged)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    recording = open_recording(tmp_path / "bag")
    assert len(list(recording.read())) >= 20
    recording.close()


def test_one_broken_file_of_several_is_said(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", numbered(range(20)))
    (tmp_path / "bag" / "bag_1.db3").write_bytes(b"nothing of a database" * 100)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    recording = open_rosbag2(tmp_path / "bag")
    assert len(list(recording.read())) == 20
    assert recording.loss.bytes == 2100
    assert any(note.startswith("bag_1.db3: ") for note in recording.loss.notes)
    recording.close()


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\x00", b"text" * 2000])
def test_a_broken_file_alone_is_said_in_a_line(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.db3").write_bytes(content)
    with pytest.raises(OpenError, match=r"a\.db3: unreadable ROS 2 bag") as caught:
        open_rosbag2(tmp_path / "a.db3")
    assert "\n" not in str(caught.value)


def test_what_a_killed_recorder_left_beside_its_database_is_read(tmp_path: Path) -> None:
    messages = numbered(range(30), ["/a"])
    write_bag(tmp_path / "bag", messages[:10])
    file = tmp_path / "bag" / "bag.db3"
    database = sqlite3.connect(file)
    database.execute("PRAGMA journal_mode = WAL")
    rows = [(1, stamp_ns, data) for _, stamp_ns, data in messages[10:]]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()
    killed = tmp_path / "killed"
    killed.mkdir()
    for name in ("bag.db3", "bag.db3-wal"):
        (killed / name).write_bytes((tmp_path / "bag" / name).read_bytes())
    database.close()
    recording = open_rosbag2(killed)
    assert written(recording.read()) == messages
    recording.close()


def test_of_a_cut_mcap_in_a_bag_the_whole_records_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(1000, 1300)), StoragePlugin.MCAP)
    file = folder / "bag.mcap"
    expected = [s for part in parts(file) for s in part.stamps_ns]
    file.write_bytes(file.read_bytes()[:-1])
    recording = open_rosbag2(folder)
    assert [entry.stamp_ns for entry in recording.read()] == expected
    assert recording.loss.messages == 0
    assert recording.loss.notes[0].startswith("bag.mcap: its end is missing")
    recording.close()


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_damaged_compressed_bags_raise_nothing(tmp_path: Path, mode: CompressionMode) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(300)), compression=(mode, CompressionFormat.ZSTD))
    [file] = [f for f in folder.iterdir() if f.suffix != ".yaml"]
    content = file.read_bytes()
    chance = random.Random(3)
    for _ in range(10):
        damaged = bytearray(content)
        place = chance.randrange(len(content) // 2, len(content))
        damaged[place : place + 4] = b"?!?!"
        file.write_bytes(damaged)
        try:
            recording = open_rosbag2(folder)
        except OpenError:
            continue
        stamps_ns = [entry.stamp_ns for entry in recording.read()]
        assert stamps_ns == sorted(stamps_ns)
        assert len(stamps_ns) <= 300
        recording.close()


@pytest.mark.parametrize("data", [b"?\xb5\x2f\xfd cut", b"\0"], ids=["magic", "short"])
def test_what_is_neither_compressed_nor_a_message_is_said(tmp_path: Path, data: bytes) -> None:
    folder = tmp_path / "bag"
    messages = numbered(range(30))
    how = (CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    write_bag(folder, messages, compression=how)
    [file] = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as database:
        database.execute("UPDATE messages SET data = ? WHERE id = 7", (data,))
        database.execute("UPDATE messages SET data = ? WHERE id = 9", (messages[8].data,))
        database.commit()
    recording = open_rosbag2(folder)
    assert written(recording.read()) == messages[:6] + messages[7:]
    assert recording.loss.messages == 1
    assert recording.loss.notes == ["messages that are neither zstd data nor CDR"]
    recording.close()


@pytest.mark.parametrize("bytes_cut", [1, 70, 1000])
def test_a_cut_within_the_last_page_of_a_database_is_said(tmp_path: Path, bytes_cut: int) -> None:
    _, file = made(tmp_path / "bag", (20_000, 30_000), 40)
    file.write_bytes(file.read_bytes()[:-bytes_cut])
    for path in (tmp_path / "bag", file):
        recording = open_rosbag2(path)
        assert "its end is missing" in recording.loss.notes[0]
        recording.close()


@pytest.mark.parametrize("tenth", [3, 5, 7, 9])
def test_a_cut_of_a_database_without_an_index_is_said(tmp_path: Path, tenth: int) -> None:
    messages, file = made(tmp_path / "bag")
    database = sqlite3.connect(file)
    database.execute("DROP INDEX timestamp_idx")
    database.execute("VACUUM")
    database.close()
    recording = open_rosbag2(file)
    assert written(recording.read()) == messages
    assert not recording.loss
    recording.close()
    file.write_bytes(file.read_bytes()[: file.stat().st_size * tenth // 10 + tenth])
    recording = open_rosbag2(file)
    assert 0 < len(written(recording.read())) < len(messages)
    assert recording.loss.notes[0].startswith("cut off or damaged, read as far as possible: ")
    recording.close()


def killed(bag: Path, folder: Path, mode: str, stop: str) -> Path:
    """A bag as it is left when its writer is killed, which also wrote messages of its own."""
    writer = sqlite3.connect(bag / "bag.db3", isolation_level=None)
    for said in (f"journal_mode = {mode}", "cache_size = 4", "wal_autocheckpoint = 0"):
        writer.execute(f"PRAGMA {said}").fetchall()
    writer.execute("BEGIN")
    for number in range(200):
        values = (1, 5000 + number, text("one more " * 30))
        writer.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", values)
    writer.execute(stop)
    shutil.copytree(bag, folder)
    writer.close()
    return folder


@pytest.mark.parametrize(
    ("mode", "stop", "left"),
    [("wal", "COMMIT", "wal"), ("wal", "SELECT 1", "wal"), ("delete", "SELECT 1", "journal")],
)
def test_a_database_whose_writer_was_killed_is_said(
    tmp_path: Path, mode: str, stop: str, left: str
) -> None:
    messages = write_bag(tmp_path / "bag", numbered(range(400)))
    recording = open_rosbag2(killed(tmp_path / "bag", tmp_path / "killed", mode, stop))
    found = written(recording.read())
    assert set(messages) <= set(found)
    assert len(found) - len(messages) == (200 if stop == "COMMIT" else len(found) - 400)
    notes = " ".join(recording.loss.notes)
    assert (
        f"bag.db3: never finished by its recorder, which left bag.db3-{left} beside it; " in notes
    )
    recording.close()


@pytest.mark.parametrize("mode", ["persist", "truncate", "delete"])
def test_a_journal_that_is_done_with_is_no_loss(tmp_path: Path, mode: str) -> None:
    write_bag(tmp_path / "bag", numbered(range(400)))
    recording = open_rosbag2(killed(tmp_path / "bag", tmp_path / "whole", mode, "COMMIT"))
    assert len(written(recording.read())) == 600
    assert recording.loss.notes == ["metadata.yaml lists 400 messages; found 600"]
    recording.close()


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (("bag_0", "bag_2"), ["bag_1.db3 is missing"]),
        (("bag_1", "bag_2"), ["bag_0.db3 is missing"]),
        (("bag_0", "bag_1"), []),
        (("2024_05", "2024_07_b"), []),
        (("bag_20240101", "bag_20240103"), []),
    ],
)
def test_a_gap_in_the_numbers_of_a_split_bag_is_said(
    tmp_path: Path, names: tuple[str, ...], missing: list[str]
) -> None:
    for number, name in enumerate(names):
        write_bag(tmp_path / name, numbered(range(10 * number, 10 * number + 10)))
        (tmp_path / "all").mkdir(exist_ok=True)
        (tmp_path / name / f"{name}.db3").rename(tmp_path / "all" / f"{name}.db3")
    recording = open_rosbag2(tmp_path / "all")
    assert len(written(recording.read())) == 20
    assert recording.loss.notes == missing
    recording.close()
