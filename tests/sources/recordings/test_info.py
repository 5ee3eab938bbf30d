"""What ``info`` tells of recordings, in figures and in words."""

import json
import re

import av
import made_bags
import numpy as np
import pytest
from made_bags import START_NS, BagWriter

from ros_visualise.commands import info, main
from ros_visualise.sources.recordings.summary import mean_rate


@pytest.fixture
def tell(capsys):
    def tell(path, as_json=False, status=0):
        assert main(["info", str(path), *["--json"] * as_json]) == status
        return capsys.readouterr().out

    return tell


def test_as_json(tmp_path, tell):
    path = tmp_path / "made.bag"
    made_bags.drive(path, "lz4")
    found = json.loads(tell(path, as_json=True))
    size = path.stat().st_size
    assert found["topics"]["/imu"] == {
        "type": "sensor_msgs/msg/Imu",
        "messages": 60,
        "hz": 1000.0,
        "connections": 1,
    }
    assert found["topics"]["/cam/image_raw"]["hz"] == 100.0
    assert found["types"]["sensor_msgs/msg/Imu"] == "6a62c6daae103f4ff57a132d6f95cec2"
    assert (found["path"], found["format"], found["size"]) == (str(path), "rosbag 2.0", size)
    assert (found["messages"], found["compression"]) == (120, "lz4")
    assert found["start"] == 1600000000.0
    assert found["end"] == pytest.approx(1600000000.195)
    assert found["duration"] == pytest.approx(0.195)
    assert found["lost"] == {"messages": 0, "bytes": 0, "notes": []}


def test_as_text(tmp_path, tell):
    path = tmp_path / "made.bag"
    with BagWriter(path) as bag:
        for key in "ab":
            bag.connect(key, "/chatter", "std_msgs/msg/String", callerid=f"/{key}")
        bag.connect("c", "/x", "my/msg/A", msgdef="!", md5sum="1" * 32)
        bag.write("c", START_NS, b"")
        for number in range(3):
            data = made_bags.T["std_msgs/msg/String"]("hi")
            bag.write("ab"[number % 2], START_NS + number * 61_000_000_000, data)
    lines = tell(path).splitlines()
    assert lines[0] == f"path:        {path}"
    assert "duration:    2:02s (122s)" in lines
    assert "types:       my/A            [11111111111111111111111111111111]" in lines
    assert "             std_msgs/String [992ce8a1687cec8c8bd883ec73ca41d1]" in lines
    assert "topics:      /chatter   3 msgs @ 0.016 Hz : std_msgs/String (2 connections)" in lines
    assert lines[-1].startswith(
        "             /x         1 msg  @        - : my/A            (cannot"
    )
    assert not any(line.startswith("lost") for line in lines)


def test_times_are_local_and_say_so(tmp_path, tell, monkeypatch):
    import time

    path = tmp_path / "made.bag"
    made_bags.drive(path, steps=1)
    with monkeypatch.context() as patch:
        patch.setenv("TZ", "XYZ-3")
        time.tzset()
        found = tell(path)
    time.tzset()
    assert "start:       Sep 13 2020 15:26:40.00 XYZ (1600000000.00)" in found


def test_what_is_lost_is_told(tmp_path, tell):
    path = tmp_path / "cut.bag"
    made_bags.drive(path)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    lost = json.loads(tell(path, as_json=True, status=1))["lost"]
    assert lost["bytes"] > len(data) // 3
    *_, amount, why = tell(path, status=1).splitlines()
    assert amount == f"lost:        {lost['bytes']} bytes"
    assert re.fullmatch(r" +cut off after [\d.]+ of at least [\d.]+ MB", why)


def test_a_video_is_told_of_in_the_same_way(tmp_path, tell):
    path = make_video(tmp_path / "clip.mp4", frames=20)
    lines = tell(path).splitlines()
    assert [line.partition(":")[0] for line in lines] == [
        *("path", "format", "duration", "start", "end", "size", "messages", "images", "topics")
    ]
    assert lines[3:5] == ["start:       0.00", "end:         2.00"]
    assert lines[-2] == "images:      64x48, 10 fps, mpeg4"
    assert lines[-1] == "topics:      /image_raw   20 msgs @ 10.0 Hz : sensor_msgs/msg/Image"
    made_bags.drive(tmp_path / "made.bag")
    found, of_bag = (json.loads(tell(p, as_json=True)) for p in (path, tmp_path / "made.bag"))
    only = {"width", "height", "fps", "codec"}
    assert found["lost"] == of_bag["lost"] == {"messages": 0, "bytes": 0, "notes": []}
    assert found.keys() - only <= of_bag.keys()
    assert found["topics"]["/image_raw"].keys() <= of_bag["topics"]["/imu"].keys()


def test_a_video_that_ends_early_is_told_of(tmp_path, tell):
    path = make_video(tmp_path / "clip.mkv", frames=20)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    found = json.loads(tell(path, as_json=True, status=1))
    assert found["messages"] < 20
    (why,) = found["lost"]["notes"]
    assert "cut off after" in why
    *_, amount, told = tell(path, status=1).splitlines()
    assert amount.startswith("lost:  ")
    assert told.strip() == why


def test_one_image_has_no_rate(tmp_path, tell):
    path = make_video(tmp_path / "clip.mp4", frames=1)
    last = tell(path).splitlines()[-1]
    assert last == "topics:      /image_raw   1 msg  @ - : sensor_msgs/msg/Image"


def make_video(path, frames):
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for number in range(frames):
            pixels = np.full((48, 64, 3), number, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, "rgb24")))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("command", ["info", "convert"])
def test_what_can_be_given_is_said(tmp_path, capsys, command):
    path = tmp_path / "notes.md"
    path.write_text("# Notes\n")
    assert main([command, str(path), *[str(tmp_path / "r.mcap")] * (command == "convert")]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"ros-visualise: {path}: neither a recording (.bag, .mcap, ")
    assert said.endswith(" a video that FFmpeg can read; check the path, or copy the file again\n")


@pytest.mark.parametrize(
    ("stamps_ns", "hz"),
    [
        ([], None),
        ([5], None),
        ([5, 5, 5], None),
        ([0, 10**7, 2 * 10**7, 10**9], 100.0),
        ([0, 10**7, 4 * 10**7], 50.0),
    ],
)
def test_the_rate_goes_by_the_median(stamps_ns, hz):
    assert mean_rate(np.array(stamps_ns, np.int64)) == hz


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.0, "0.0s"), (59.5, "59.5s"), (740.5, "12:20s (740s)"), (7384.0, "2hr 3:04s (7384s)")],
)
def test_durations_are_written_as_ros_does(seconds, text):
    assert info._duration(seconds) == text
