"""``info --check`` reads all of a recording, and tells what no index shows."""

import json
import shutil
import sys
from pathlib import Path

import forked
import numpy as np
import pytest
from made_mcaps import numbered as strings
from made_mcaps import write_mcap
from made_videos import numbered, write_video

from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder


def info(path: Path, *options: str) -> tuple[int, dict]:
    command = [sys.executable, "-m", "ros_visualise", "info", str(path), "--json", *options]
    done = forked.run(command, timeout=60)
    return done.returncode, json.loads(done.stdout)


@pytest.mark.parametrize(("suffix", "packed"), [("mcap", "zstd"), ("bag", "bz2")])
def test_a_damaged_chunk_is_told(tmp_path: Path, suffix: str, packed: str) -> None:
    path = tmp_path / f"a.{suffix}"
    rng = np.random.default_rng(1)
    topics = {"/image": TopicType("sensor_msgs/msg/Image")}
    with open_recorder(str(path), topics, compression=packed, live=False) as recorder:
        for number in range(40):
            image = Image(rng.integers(0, 256, (200, 300), np.uint8), "mono8", Header(number))
            recorder.write("/image", image, number)
    assert [status for status, _ in (info(path), info(path, "--check"))] == [0, 0]
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 100] = bytes(100)
    path.write_bytes(data)
    assert info(path)[0] == 0
    status, found = info(path, "--check")
    assert status == 1
    assert 0 < found["lost"]["messages"] <= 40
    assert found["lost"]["notes"]


def test_a_changed_payload_outside_chunks_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    messages = write_mcap(
        path, strings(range(1000, 1060)), use_chunking=False, enable_data_crcs=True
    )
    play = [sys.executable, "-m", "ros_visualise", "bag", str(path), "--view", "none"]
    play += ["--rate", "0", "--record", str(tmp_path / "copy.mcap")]
    assert info(path, "--check")[0] == 0
    assert forked.run([*play, "--overwrite"], timeout=60).returncode == 0
    data = bytearray(path.read_bytes())
    data[data.index(messages[7].data) + 12] ^= 1
    path.write_bytes(data)
    status, found = info(path, "--check")
    assert (status, found["lost"]["notes"]) == (1, ["checksum mismatch"])
    played = forked.run([*play, "--overwrite"], timeout=60)
    assert played.returncode == 1
    assert played.stderr.count("checksum mismatch") == 1


def test_a_damaged_image_of_kitti_is_told(tmp_path: Path, recordings: Path) -> None:
    drive = shutil.copytree(recordings / "kitti" / "drive0009_f000-004", tmp_path / "drive")
    image = next(drive.glob("**/image_02/data/*2.png"))
    image.write_bytes(image.read_bytes()[:5000])
    assert info(drive)[0] == 0
    status, found = info(drive, "--check")
    assert (status, found["lost"]["messages"]) == (1, 1)
    assert found["lost"]["notes"] == ["image_02/data/0000000002.png: cut off"]


def test_a_whole_video_is_whole_and_a_damaged_one_is_told(tmp_path: Path) -> None:
    path = write_video(tmp_path / "v.mp4", numbered(30, 160, 120))
    assert info(path, "--check")[0] == 0
    data = bytearray(path.read_bytes())
    start = data.index(b"mdat") + len(data) // 4
    data[start : start + len(data) // 3] = np.random.default_rng(2).bytes(len(data) // 3)
    path.write_bytes(data)
    status, found = info(path, "--check")
    assert (status, bool(found["lost"]["notes"])) == (1, True)
