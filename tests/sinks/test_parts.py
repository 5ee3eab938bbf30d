"""A recording in several files: each can be read alone, and together they are the whole."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.data import (
    CameraInfo,
    Header,
    Image,
    ParameterEvent,
    Text,
    Transforms,
    TransformStamped,
)
from ros_visualise.messages.qos import LATCHED
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import PARAMETER_EVENTS, open_recorder
from ros_visualise.sinks.parts import Split, parse_split
from ros_visualise.sources.opening import open_recording

SECOND = 10**9
TOPICS = {
    "/image": TopicType(Image.type_name),
    "/camera_info": TopicType(CameraInfo.type_name),
    "/tf_static": TopicType(Transforms.type_name),
    "/description": TopicType(Text.type_name, qos=LATCHED),
}
KINDS = ["run.mcap", "run.bag", "run"]
TEN_SECONDS = Split(span_ns=10 * SECOND)
COUNT = 35


def frame(child: str, stamp_ns: int) -> Transforms:
    unturned = np.array([0.0, 0, 0, 1])
    return Transforms((TransformStamped(child, np.zeros(3), unturned, Header(stamp_ns, "base")),))


def image(number: int) -> Image:
    pixels = np.random.default_rng(number).integers(0, 255, (40, 40), np.uint8)
    return Image(pixels, "mono8", Header(number * SECOND, "camera"))


def record(path: Path, split: Split | None, overwrite: bool = False, count: int = COUNT) -> None:
    """Images once a second; what lasts comes in the first seconds, but for a frame after 12."""
    with open_recorder(path, TOPICS, overwrite, split=split) as recorder:
        for text in ("old", "new"):
            recorder.write("/description", Text(text), SECOND)
        recorder.write("/camera_info", CameraInfo(40, 40, np.diag([7.0, 7, 1])), SECOND)
        recorder.write("/tf_static", frame("camera", SECOND), SECOND)
        event = ParameterEvent("node", new={"low": 1, "high": 2}, header=Header(SECOND))
        recorder.write(PARAMETER_EVENTS, event)
        for number in range(1, count + 1):
            if number == 12:
                recorder.write("/tf_static", frame("lidar", 12 * SECOND), 12 * SECOND)
                event = ParameterEvent("node", changed={"low": 5}, header=Header(12 * SECOND))
                recorder.write(PARAMETER_EVENTS, event)
            recorder.write("/image", image(number))


def files(path: Path) -> list[Path]:
    """The parts in their order."""
    folder = path if path.is_dir() else path.parent
    return sorted(folder.glob(f"{path.stem}_*"), key=lambda one: int(one.stem.rpartition("_")[2]))


def read(path: Path) -> list[tuple[str, int, Any]]:
    """Topic, second and message, as the rosbags library reads one file or folder."""
    with AnyReader([path]) as reader:
        return [
            (one.topic, stamp_ns // SECOND, reader.deserialize(raw, one.msgtype))
            for one, stamp_ns, raw in reader.messages()
        ]


@pytest.mark.parametrize("name", KINDS)
def test_each_part_is_read_alone_and_begins_with_what_lasts(name: str, tmp_path: Path) -> None:
    record(tmp_path / name, TEN_SECONDS)
    parts = files(tmp_path / name)
    suffix = Path(name).suffix or ".mcap"
    assert [one.name for one in parts] == [f"run_{number}{suffix}" for number in range(4)]
    seconds = []
    for number, part in enumerate(parts):
        found = read(part)
        first = found[0][1]
        seconds.append([second for topic, second, _ in found if topic == "/image"])
        begins = [one for one in found if one[1] == first and one[0] != "/image"]
        texts = [message.data for topic, _, message in begins if topic == "/description"]
        assert texts == (["new"] if number else ["old", "new"])
        frames = [
            one.child_frame_id
            for topic, _, message in begins
            if topic == "/tf_static"
            for one in message.transforms
        ]
        assert frames == (["camera"] if number < 2 else ["camera", "lidar"])
        assert sum(topic == "/camera_info" for topic, *_ in begins) == 1
    assert seconds == [[*range(1, 11)], [*range(11, 21)], [*range(21, 31)], [*range(31, 36)]]


@pytest.mark.parametrize("name", ["run.mcap", "run"])
def test_each_part_tells_all_parameters_as_they_were(name: str, tmp_path: Path) -> None:
    record(tmp_path / name, TEN_SECONDS)
    told = []
    for part in files(tmp_path / name):
        event = next(m for topic, _, m in read(part) if topic == PARAMETER_EVENTS)
        told.append({p.name: p.value.integer_value for p in event.new_parameters})
    assert told == [{"low": 1, "high": 2}] * 2 + [{"low": 5, "high": 2}] * 2


@pytest.mark.parametrize("name", KINDS)
def test_the_parts_play_together(name: str, tmp_path: Path) -> None:
    (tmp_path / "all").mkdir()
    record(tmp_path / "all" / name, TEN_SECONDS)
    recording = open_recording(tmp_path / "all" / name if name == "run" else tmp_path / "all")
    stamps = [entry.stamp_ns for entry in recording.read() if entry.topic == "/image"]
    recording.close()
    assert stamps == [number * SECOND for number in range(1, COUNT + 1)]
    assert not recording.loss


def test_the_folder_describes_all_its_files(tmp_path: Path) -> None:
    record(tmp_path / "run", TEN_SECONDS)
    with AnyReader([tmp_path / "run"]) as reader:
        counts = {one.topic: one.msgcount for one in reader.connections}
        found = Counter(one.topic for one, _, _ in reader.messages())
        assert (reader.start_time, reader.end_time) == (SECOND, COUNT * SECOND + 1)
    assert counts == found
    assert (counts["/image"], counts["/tf_static"]) == (COUNT, 1 + 1 + 1 + 2 + 2)


@pytest.mark.parametrize("name", KINDS)
def test_parts_are_about_as_large_as_asked_and_the_same_each_time(
    name: str, tmp_path: Path
) -> None:
    sizes = []
    for again in ("a", "b"):
        (tmp_path / again).mkdir()
        record(tmp_path / again / name, Split(size=2**16), count=200)
        parts = files(tmp_path / again / name)
        sizes.append([one.read_bytes() for one in parts])
    assert sizes[0] == sizes[1]
    assert len(sizes[0]) >= 4
    assert all(2**16 <= len(data) < 2**17 for data in sizes[0][:-1])
    numbers = [s for part in parts for topic, s, _ in read(part) if topic == "/image"]
    assert numbers == [*range(1, 201)]


def test_a_part_is_whole_when_the_next_begins(tmp_path: Path) -> None:
    recorder = open_recorder(tmp_path / "run.mcap", TOPICS, split=TEN_SECONDS)
    for number in range(1, 25):
        recorder.write("/image", image(number))
    with (tmp_path / "run_1.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 10
    recorder.close()


def test_times_that_no_file_holds_begin_no_part(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "run.mcap", TOPICS, split=TEN_SECONDS) as recorder:
        recorder.write("/image", image(100))
        for _ in range(3):
            with pytest.raises(Exception, match="cannot store a stamp"):
                recorder.write("/image", image(100), -5 * SECOND)
            recorder.write("/image", image(101))
    assert len(files(tmp_path / "run.mcap")) == 1


@pytest.mark.parametrize("name", ["run.mcap", "run.bag"])
def test_parts_of_another_recording_are_kept_or_replaced_all_together(
    name: str, tmp_path: Path
) -> None:
    record(tmp_path / name, TEN_SECONDS)
    (tmp_path / f"run_x{Path(name).suffix}").write_bytes(b"another")
    with pytest.raises(OpenError, match=r"run_0.* exists"):
        record(tmp_path / name, TEN_SECONDS)
    record(tmp_path / name, TEN_SECONDS, overwrite=True, count=15)
    there = sorted(one.stem for one in tmp_path.iterdir())
    assert there == ["run_0", "run_1", "run_x"]


def test_a_folder_of_parts_is_replaced_as_a_whole(tmp_path: Path) -> None:
    record(tmp_path / "run", TEN_SECONDS)
    record(tmp_path / "run", None, overwrite=True)
    assert sorted(one.name for one in (tmp_path / "run").iterdir()) == [
        "metadata.yaml",
        "run_0.mcap",
    ]


SPLITS = {
    "1G": Split(size=2**30),
    "1.5M": Split(size=3 * 2**19),
    "500MB": Split(size=500 * 2**20),
    "10m": Split(span_ns=600 * SECOND),
    "90s": Split(span_ns=90 * SECOND),
    "1h": Split(span_ns=3600 * SECOND),
}


@pytest.mark.parametrize(("text", "split"), SPLITS.items(), ids=SPLITS)
def test_sizes_and_times_are_told_apart_by_their_letters(text: str, split: Split) -> None:
    assert parse_split(text) == split


@pytest.mark.parametrize(
    "text", ["", "1", "1K", "0s", "0.5s", "-1G", "1g", "10M30s", "nanG", "1e9G"]
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(UsageError, match="give a size such as 1G or 500M"):
        parse_split(text)


def test_what_lasts_is_repeated_in_the_order_in_which_it_was_said(tmp_path: Path) -> None:
    def frames(message: Transforms, *others: Transforms) -> Transforms:
        return Transforms(sum((one.transforms for one in others), message.transforms))

    with open_recorder(tmp_path / "run.mcap", TOPICS, split=TEN_SECONDS) as recorder:
        both = frames(frame("camera", SECOND), frame("lidar", SECOND))
        recorder.write("/tf_static", both, SECOND)
        recorder.write("/tf_static", frame("camera", 2 * SECOND), 2 * SECOND)
        recorder.write("/image", image(20))
    said = {
        one.child_frame_id: one.header.stamp.sec
        for topic, _, message in read(tmp_path / "run_1.mcap")
        if topic == "/tf_static"
        for one in message.transforms
    }
    assert said == {"camera": 2, "lidar": 1}


def test_what_was_recorded_of_parameters_before_is_repeated_for_all_nodes(tmp_path: Path) -> None:
    topics = {PARAMETER_EVENTS: TopicType(ParameterEvent.type_name)}
    with open_recorder(tmp_path / "first.mcap", topics, live=False) as recorder:
        for node, new in (("a", {"low": 1}), ("a", {"high": 2}), ("b", {"low": 3})):
            recorder.write(PARAMETER_EVENTS, ParameterEvent(node, new=new, header=Header(SECOND)))
    again = {**topics, "/image": TOPICS["/image"]}
    recording = open_recording(tmp_path / "first.mcap")
    with open_recorder(tmp_path / "run.mcap", again, live=False, split=TEN_SECONDS) as recorder:
        for entry in recording.read():
            recorder.write(entry.topic, entry.message)
        recorder.write("/image", image(20))
    recording.close()
    told = {
        message.node: {one.name for one in message.new_parameters}
        for topic, _, message in read(tmp_path / "run_1.mcap")
        if topic == PARAMETER_EVENTS
    }
    assert told == {"/a": {"low", "high"}, "/b": {"low"}}


def test_what_lasts_does_not_fill_a_part(tmp_path: Path) -> None:
    with open_recorder(tmp_path / "run.mcap", TOPICS, split=Split(size=2**16)) as recorder:
        noise = np.random.default_rng(1).integers(32, 127, 2**18, np.uint8).tobytes().decode()
        recorder.write("/description", Text(noise), SECOND)
        for number in range(1, 100):
            recorder.write("/image", image(number))
    assert len(files(tmp_path / "run.mcap")) <= 1 + 99 * 1600 // 2**16 + 1


def test_a_file_that_continues_no_earlier_recording_is_kept(tmp_path: Path) -> None:
    record(tmp_path / "run.mcap", TEN_SECONDS)
    record(tmp_path / "run_2026.mcap", None)
    record(tmp_path / "run.mcap", TEN_SECONDS, overwrite=True, count=5)
    assert sorted(one.stem for one in tmp_path.iterdir()) == ["run_0", "run_2026"]


def test_a_video_is_not_split(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"\.mp4 files cannot be split"):
        open_recorder(tmp_path / "v.mp4", TOPICS, split=TEN_SECONDS)
