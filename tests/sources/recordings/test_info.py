"""What ``info`` tells of recordings, in figures and in words."""

import json
from argparse import Namespace

import made_bags
import numpy as np
import pytest
from made_bags import START_NS, BagWriter

from ros_visualise.commands import info
from ros_visualise.sources.recordings.summary import mean_rate


@pytest.fixture
def tell(capsys):
    def tell(path, as_json=False):
        assert info.run(Namespace(input=str(path), json=as_json)) == 0
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
    assert "topics:      /chatter   3 msgs @ 0.0 Hz : std_msgs/String (2 connections)" in lines
    assert lines[-1].startswith("             /x         1 msg           : my/A            (cannot")
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
    assert "lost:        0 messages, " in tell(path)
    assert json.loads(tell(path, as_json=True))["lost"]["bytes"] > len(data) // 3


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
