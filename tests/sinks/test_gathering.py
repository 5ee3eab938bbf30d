"""Messages that are gathered in chunks: none is lost, and the file is always the same."""

from pathlib import Path

import pytest
from gathering import TOPICS, image, read, read_as_it_is_now
from mcap.reader import make_reader

from ros_visualise.core.errors import DamagedMessage, RecordingError
from ros_visualise.sinks import COMPRESSIONS, open_recorder

LARGE = 300  # pixels; such an image makes a chunk of its own
STEP_NS = 10_000_000
FILES = [(f"r.{kind}", c) for kind in ("mcap", "bag") for c in COMPRESSIONS[kind]]


def stamps(count: int) -> list[tuple[str, int]]:
    """More than a second; now and then something large."""
    return [("/a" if i % 3 else "/b", 1 + i * STEP_NS) for i in range(count)]


def size(number: int) -> int:
    return LARGE if number % 50 == 49 else 20


@pytest.mark.parametrize(("name", "compression"), FILES)
def test_an_unfinished_file_holds_all_that_was_written(
    tmp_path: Path, name: str, compression: str
) -> None:
    written: list[tuple[str, int]] = []
    with open_recorder(f"{tmp_path}/{name}", TOPICS, compression=compression) as recorder:
        for number, (topic, stamp_ns) in enumerate(stamps(230)):
            recorder.write(topic, image(stamp_ns, size(number)))
            written.append((topic, stamp_ns))
            if number % 23 == 0 or size(number) == LARGE:
                assert read_as_it_is_now(recorder.path) == written
    assert read(recorder.path) == written


@pytest.mark.parametrize(("name", "compression"), FILES)
def test_the_same_messages_make_the_same_bytes(tmp_path: Path, name: str, compression: str) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        with open_recorder(
            f"{tmp_path}/{folder}/{name}", TOPICS, compression=compression
        ) as recorder:
            for topic, stamp_ns in stamps(120):
                recorder.write(topic, image(stamp_ns))
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_small_messages_share_chunks_of_a_second_at_most(tmp_path: Path) -> None:
    with open_recorder(f"{tmp_path}/r.mcap", TOPICS) as recorder:
        for topic, stamp_ns in stamps(250):
            recorder.write(topic, image(stamp_ns))
    with recorder.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    spans = [c.message_end_time - c.message_start_time for c in summary.chunk_indexes]
    assert len(spans) == 3
    assert max(spans) < 10**9


@pytest.mark.parametrize("name", ["r.mcap", "r.bag"])
def test_what_waits_ends_with_the_recording(tmp_path: Path, name: str) -> None:
    with open_recorder(f"{tmp_path}/{name}", TOPICS, live=False) as recorder:
        recorder.write("/a", image(5))
        empty = recorder.path.stat().st_size
    assert recorder.path.stat().st_size > empty
    assert read(recorder.path) == [("/a", 5)]


@pytest.mark.parametrize("name", ["r.mcap", "r.bag"])
def test_a_stamp_that_is_given_wins(tmp_path: Path, name: str) -> None:
    with open_recorder(f"{tmp_path}/{name}", TOPICS) as recorder:
        recorder.write("/a", image(5), 7)
        with pytest.raises(DamagedMessage, match="ROS cannot store a stamp of -1 ns"):
            recorder.write("/a", image(5), -1)
        recorder.write("/b", image(8))
    assert read(recorder.path) == [("/a", 7), ("/b", 8)]


def test_a_bag_has_no_time_zero_which_ros_would_not_play(tmp_path: Path) -> None:
    with open_recorder(f"{tmp_path}/r.bag", TOPICS) as recorder:
        recorder.write("/a", image(0))
    assert read(recorder.path) == [("/a", 1)]


@pytest.mark.parametrize("name", ["r.mcap", "r.bag"])
def test_a_topic_that_comes_later_is_there_from_then_on(tmp_path: Path, name: str) -> None:
    written: list[tuple[str, int]] = []
    with open_recorder(f"{tmp_path}/{name}", TOPICS) as recorder:
        for stamp_ns, topic in enumerate(("/a", "/late", "/a", "/late", "/later"), 1):
            if topic not in recorder.topics:
                recorder.add(topic, TOPICS["/a"])
                assert read_as_it_is_now(recorder.path) == written
            recorder.write(topic, image(stamp_ns))
            written.append((topic, stamp_ns))
            assert read_as_it_is_now(recorder.path) == written
    assert read(recorder.path) == written
    with pytest.raises(RecordingError, match="has ended"):
        recorder.add("/latest", TOPICS["/a"])


def test_a_video_has_no_room_for_more_topics(tmp_path: Path) -> None:
    with open_recorder(f"{tmp_path}/r.mp4", TOPICS) as recorder:
        recorder.add("/late", TOPICS["/a"])
        recorder.write("/late", image(1, 16))
        recorder.write("/b", image(2, 16))
        assert recorder.topics == ("/b",)
