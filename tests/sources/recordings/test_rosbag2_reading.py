"""ROS 2 bags as they should be, and folders that are not as their metadata.yaml has them."""

import random
import re
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_mcaps import (
    ROS2,
    STRING,
    Written,
    in_order,
    numbered,
    text,
    write_bag,
    write_mcap,
    written,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin

from ros_visualise.core.errors import OpenError
from ros_visualise.core.yaml_files import load_yaml, to_yaml
from ros_visualise.data import LaserScan
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Recording, sqlite_file
from ros_visualise.sources.recordings.rosbag2 import open_rosbag2

STORAGES = [StoragePlugin.SQLITE3, StoragePlugin.MCAP]
each_storage = pytest.mark.parametrize("storage", STORAGES, ids=lambda s: s.name)


def mixed_up(count: int, seed: int = 1) -> list[int]:
    chance = random.Random(seed)
    return [10**18 + 5 * (i // 2) + 5 * chance.randint(-4, 4) for i in range(count)]


def split_bag(folder: Path, storage: StoragePlugin, files: int = 3) -> list[Written]:
    """A bag of several files that overlap in time, as ``ros2 bag record --max-bag-size`` makes."""
    folder.mkdir()
    names, everything = [], []
    for number in range(files):
        messages = numbered([s + 300 * number for s in mixed_up(90, seed=number)])
        write_bag(folder / "part", messages, storage)
        [file] = [f for f in (folder / "part").iterdir() if f.suffix != ".yaml"]
        names.append(f"bag_{number}{file.suffix}")
        file.rename(folder / names[-1])
        shutil.rmtree(folder / "part")
        everything += messages
    write_metadata(folder, names, len(everything))
    return everything


def write_metadata(folder: Path, names: list[str], messages: int, version: int = 5) -> None:
    listed = "".join(f"    - {name}\n" for name in names)
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: {version}\n  storage_identifier: sqlite3\n"
        f"  relative_file_paths:\n{listed}  message_count: {messages}\n"
    )


def read(folder: Path) -> tuple[list[Written], Recording]:
    recording = open_rosbag2(folder)
    found = written(recording.read())
    recording.close()
    return found, recording


@each_storage
@pytest.mark.parametrize("version", [8, 9])
def test_all_messages_come_in_order(tmp_path: Path, storage: StoragePlugin, version: int) -> None:
    messages = write_bag(tmp_path / "bag", numbered(mixed_up(200)), storage, version)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert (recording.format, not recording.loss) == ("rosbag2", True)
    assert recording.topics["/a"].digest == ROS2.hash_rihs01(STRING)
    assert recording.start_ns == found[0].stamp_ns
    assert recording.end_ns == found[-1].stamp_ns
    assert recording.topics["/b"].messages == sum(m.topic == "/b" for m in messages)


@each_storage
def test_split_bags_are_one_stream(tmp_path: Path, storage: StoragePlugin) -> None:
    messages = split_bag(tmp_path / "bag", storage)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert not recording.loss
    assert recording.topics["/a"].messages == 90
    assert recording.topics["/a"].connections == 1
    files = [file for file in (tmp_path / "bag").iterdir() if file.suffix != ".yaml"]
    assert recording.size == sum(file.stat().st_size for file in files)


@each_storage
def test_a_window_of_some_topics_is_what_it_is_of_the_whole(
    tmp_path: Path, storage: StoragePlugin
) -> None:
    messages = in_order(split_bag(tmp_path / "bag", storage))
    recording = open_rosbag2(tmp_path / "bag")
    for first, last in ((0, 20), (70, 200), (100, 100)):
        start_ns, stop_ns = messages[first].stamp_ns, messages[last].stamp_ns
        for topics in (None, ["/b"], []):
            assert written(recording.read(start_ns, stop_ns, topics)) == [
                m
                for m in messages
                if start_ns <= m.stamp_ns < stop_ns and (topics is None or m.topic in topics)
            ]
    for topic, stamps_ns in recording.stamps_ns().items():
        np.testing.assert_array_equal(stamps_ns, [m.stamp_ns for m in messages if m.topic == topic])
    recording.close()


@each_storage
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize("is_described", [True, False])
def test_compressed_bags_are_read(
    tmp_path: Path, storage: StoragePlugin, mode: Any, is_described: bool
) -> None:
    folder = tmp_path / "bag"
    how = (mode, CompressionFormat.ZSTD)
    messages = write_bag(folder, numbered(range(50)), storage, compression=how)
    if not is_described:
        (folder / "metadata.yaml").unlink()
    found, recording = read(folder)
    assert found == messages
    if is_described:
        assert recording.compression == "zstd"


@each_storage
@pytest.mark.parametrize("version", [8, 9])
def test_a_robot_with_a_map_is_read(tmp_path: Path, storage: StoragePlugin, version: int) -> None:
    types = ROS2.types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="map"
    )
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=0.0, y=0.0, z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    grid = types["nav_msgs/msg/OccupancyGrid"](
        header=header,
        info=types["nav_msgs/msg/MapMetaData"](
            map_load_time=header.stamp, resolution=0.05, width=3, height=2, origin=pose
        ),
        data=np.array([0, 100, -1, 0, 0, 50], np.int8),
    )
    scan = types["sensor_msgs/msg/LaserScan"](
        header=header,
        angle_min=-1.0,
        angle_max=1.0,
        angle_increment=1.0,
        time_increment=0.0,
        scan_time=0.1,
        range_min=0.1,
        range_max=10.0,
        ranges=np.array([1, 2, np.inf], np.float32),
        intensities=np.empty(0, np.float32),
    )
    sent = {"/map": grid, "/scan": scan}
    write_bag(
        tmp_path / "bag",
        [
            Written(t, i, bytes(ROS2.serialize_cdr(m, m.__msgtype__)))
            for i, (t, m) in enumerate(sent.items())
        ],
        storage,
        version,
        types={topic: message.__msgtype__ for topic, message in sent.items()},
        latched=["/map"],
    )
    recording = open_recording(tmp_path / "bag")
    first, second = recording.read()
    np.testing.assert_array_equal(first.message.message.data, grid.data)
    assert first.message.header.frame_id == "map"
    assert isinstance(second.message.content, LaserScan)
    latched = {topic: info.type.qos.transient_local for topic, info in recording.topics.items()}
    assert latched == {"/map": True, "/scan": False}
    recording.close()


@each_storage
def test_without_metadata_all_files_are_read(
    tmp_path: Path, storage: StoragePlugin, caplog: pytest.LogCaptureFixture
) -> None:
    messages = split_bag(tmp_path / "bag", storage)
    (tmp_path / "bag" / "metadata.yaml").unlink()
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert not recording.loss
    assert "metadata.yaml is missing" in caplog.text


@pytest.mark.parametrize(
    "content",
    ["", "{", "a: [", "- 1\n- 2", "rosbag2_bagfile_information: 3", "x: !odd 1", "\x00\x01"],
)
def test_metadata_that_cannot_be_read_is_said(tmp_path: Path, content: str) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    (tmp_path / "bag" / "metadata.yaml").write_text(content)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    [note] = recording.loss.notes
    assert note.startswith("metadata.yaml: cannot be read")


@pytest.mark.parametrize("count", ["1e400", ".nan", "1.5", "'120'"])
def test_a_count_that_is_no_number_of_messages_is_said(tmp_path: Path, count: str) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(30)))
    file = folder / "metadata.yaml"
    file.write_text(re.sub(r"message_count: \d+", f"message_count: {count}", file.read_text()))
    recording = open_recording(folder)
    assert len(list(recording.read())) == 30
    [note] = recording.loss.notes
    assert note.startswith("metadata.yaml: cannot be read")
    recording.close()


@each_storage
def test_a_file_that_is_missing_is_said_and_counted(tmp_path: Path, storage: StoragePlugin) -> None:
    messages = split_bag(tmp_path / "bag", storage)
    [middle] = (tmp_path / "bag").glob("bag_1.*")
    middle.unlink()
    found, recording = read(tmp_path / "bag")
    assert found == in_order([*messages[:90], *messages[180:]])
    assert recording.loss.messages == 90
    assert recording.loss.notes[0] == f"{middle.name} is missing"


def test_renamed_files_are_found(tmp_path: Path) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3, files=12)
    write_metadata(tmp_path / "bag", ["old_name_0.db3"], len(messages))
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert recording.loss.notes == ["old_name_0.db3 is missing"]


def test_names_in_a_folder_of_the_recorder_are_found_here(tmp_path: Path) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    names = ["bag/bag_0.db3", "C:\\bags\\bag_1.db3", "bag_2.db3", "bag_2.db3"]
    write_metadata(tmp_path / "bag", names, len(messages), version=2)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert not recording.loss


def test_a_file_beside_the_named_ones_is_left_alone(tmp_path: Path) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    write_mcap(tmp_path / "bag" / "converted.mcap", messages)
    found, _ = read(tmp_path / "bag")
    assert found == in_order(messages)


@pytest.mark.parametrize("claimed", [0, 10, 500])
def test_a_count_that_differs_is_said(tmp_path: Path, claimed: int) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    write_metadata(tmp_path / "bag", [f"bag_{i}.db3" for i in range(3)], claimed)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages)
    assert recording.loss.messages == max(0, claimed - len(messages))
    assert recording.loss.notes == [
        f"metadata.yaml lists {claimed} messages; found {len(messages)}"
    ]


@each_storage
@pytest.mark.parametrize(
    ("key", "where"),
    [
        (("topics_with_message_count", 1), " on /b"),
        (("files", 0), " in {file}"),
        ((), ""),
    ],
)
def test_each_count_of_the_metadata_is_compared(
    tmp_path: Path, storage: StoragePlugin, key: tuple[str, int], where: str
) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(30)), storage)
    assert not read(folder)[1].loss
    path = folder / "metadata.yaml"
    values = load_yaml(path)
    counted = about = values["rosbag2_bagfile_information"]
    for part in key:
        counted = counted[part]
    counted["message_count"] -= 1
    path.write_text(to_yaml(values))
    found, recording = read(folder)
    assert len(found) == 30
    [file] = about["relative_file_paths"]
    there = 10 if key[:1] == ("topics_with_message_count",) else 30
    told = f"{there - 1} messages{where.format(file=file)}; found {there}"
    assert recording.loss.notes == [f"metadata.yaml lists {told}"]
    assert recording.loss.messages == 0


def test_a_part_that_the_metadata_does_not_name_is_said(tmp_path: Path) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    write_metadata(tmp_path / "bag", [f"bag_{i}.db3" for i in range(2)], 180)
    found, recording = read(tmp_path / "bag")
    assert found == in_order(messages[:180])
    assert recording.loss.notes == ["bag_2.db3 is not listed in metadata.yaml"]


def test_rows_that_are_gone_are_said(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(30)))
    with closing(sqlite3.connect(folder / "bag.db3")) as database:
        database.execute("DELETE FROM messages WHERE topic_id = 2 AND timestamp > 20")
        database.commit()
    _, recording = read(folder)
    assert recording.loss.messages == 3
    assert recording.loss.notes == ["metadata.yaml lists 30 messages; found 27"]


def test_a_single_file_is_a_bag(tmp_path: Path) -> None:
    messages = split_bag(tmp_path / "bag", StoragePlugin.SQLITE3)
    found, recording = read(tmp_path / "bag" / "bag_1.db3")
    assert found == in_order(messages[90:180])
    assert not recording.loss


def test_types_of_ros_need_no_definition_and_others_do(tmp_path: Path) -> None:
    database = sqlite3.connect(tmp_path / "old.db3")
    database.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT,"
        " serialization_format TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
        " data BLOB);"
        "INSERT INTO topics VALUES (1, '/text', 'std_msgs/msg/String', 'cdr');"
        "INSERT INTO topics VALUES (2, '/mine', 'my_msgs/msg/Mine', 'cdr');"
        "INSERT INTO topics VALUES (3, '/other', 'std_msgs/msg/String', 'protobuf');"
    )
    rows = [(i % 4 + 1, 100 - i, text(f"{i}")) for i in range(40)]
    database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
    database.commit()
    database.close()
    found, recording = read(tmp_path / "old.db3")
    names = {1: "/text", 2: "/mine"}
    assert found == [Written(names[n], stamp, d) for n, stamp, d in rows[::-1] if n in names]
    unreadable = {topic: info.unreadable for topic, info in recording.topics.items()}
    assert unreadable["/text"] == ""
    assert "not defined in the recording" in unreadable["/mine"]
    assert unreadable["/other"] == "protobuf: only ROS messages are supported"
    assert recording.loss.messages == 10


@each_storage
def test_a_bag_without_messages_is_empty(tmp_path: Path, storage: StoragePlugin) -> None:
    write_bag(tmp_path / "bag", [], storage)
    found, recording = read(tmp_path / "bag")
    assert (found, recording.start_ns, recording.end_ns) == ([], 0, 0)
    assert recording.stamps_ns() == {}
    assert not recording.loss


@each_storage
def test_closing_ends_reading(tmp_path: Path, storage: StoragePlugin) -> None:
    write_bag(tmp_path / "bag", numbered(range(500)), storage)
    recording = open_rosbag2(tmp_path / "bag")
    entries = recording.read()
    next(entries)
    recording.close()
    recording.close()
    assert list(entries) == []
    assert list(recording.read()) == []


def test_a_folder_without_files_is_said_in_a_line(tmp_path: Path) -> None:
    write_metadata(tmp_path, ["bag_0.db3"], 5)
    with pytest.raises(OpenError, match=r"no \.db3 or \.mcap file") as caught:
        open_rosbag2(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "counts", "seconds"),
    [
        ("evo_tf_example", {"/tf": 517, "/tf_static": 1}, 51.684723334),
        (
            "plotjuggler_rosbag2_test",
            {"/battery": 1565, "/imu": 1565, "/parameter_events": 0, "/pose": 1565, "/rosout": 0},
            62.560451324,
        ),
    ],
)
def test_real_bags_are_read(
    recordings: Path, name: str, counts: dict[str, int], seconds: float
) -> None:
    recording = open_recording(recordings / "bags" / name)
    assert {topic: info.messages for topic, info in recording.topics.items()} == counts
    assert (recording.end_ns - recording.start_ns) / 1e9 == pytest.approx(seconds, abs=1e-9)
    found = dict.fromkeys(counts, 0)
    for entry in recording.read():
        assert entry.message.message is not None
        found[entry.topic] += 1
    assert found == counts
    assert not recording.loss
    recording.close()


@pytest.fixture
def all_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file counts as a large one, and none may be counted."""

    def refuse(_: Any) -> None:
        raise AssertionError("the whole file is read when it is opened")

    monkeypatch.setattr(sqlite_file, "_LARGE_BYTES", 0)
    monkeypatch.setattr(sqlite_file.SqliteFile, "_counted", refuse)


@pytest.mark.usefixtures("all_large")
def test_a_large_file_is_not_counted_when_it_is_opened(tmp_path: Path) -> None:
    messages = write_bag(tmp_path / "bag", numbered(range(30)))
    found, recording = read(tmp_path / "bag")
    assert found == messages
    assert {name: info.messages for name, info in recording.topics.items()} == {
        "/a": 10,
        "/b": 10,
        "/c": 10,
    }
    assert (recording.start_ns, recording.end_ns) == (0, 29)
    assert not recording.loss


@pytest.mark.usefixtures("all_large")
@pytest.mark.parametrize(
    "look",
    [
        lambda one: list(one.read()),
        lambda one: list(one.read(topics=["/c", "/b"])),
        lambda one: one.stamps_ns(),
    ],
)
def test_rows_that_are_gone_from_a_large_file_are_said_at_its_end(
    tmp_path: Path, look: Any
) -> None:
    folder = tmp_path / "bag"
    write_bag(folder, numbered(range(30)))
    with closing(sqlite3.connect(folder / "bag.db3")) as database:
        database.execute("DELETE FROM messages WHERE timestamp IN (4, 7)")
        database.commit()
    recording = open_rosbag2(folder)
    assert not recording.loss
    look(recording)
    look(recording)
    assert recording.loss.messages == 2
    assert recording.loss.notes == ["metadata.yaml lists 10 messages on /b; found 8"]


@pytest.mark.usefixtures("all_large")
def test_a_part_of_a_large_file_tells_nothing_of_the_rest(tmp_path: Path) -> None:
    write_bag(tmp_path / "bag", numbered(range(30)))
    recording = open_rosbag2(tmp_path / "bag")
    assert len(list(recording.read(5, 9))) == 4
    assert len(list(recording.read(topics=["/a"]))) == 10
    assert not recording.loss
