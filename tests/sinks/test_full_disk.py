"""A disk that fills up ends a recording with one line, and what was written stays readable."""

import json
import shutil
import subprocess
import sys
from collections import namedtuple
from collections.abc import Iterable
from pathlib import Path

import av
import numpy as np
import pytest
from mcap.exceptions import EndOfFile
from mcap.records import Message
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from ros_visualise.core.errors import RecordingError
from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import Recorder, open_recorder
from ros_visualise.sources.opening import open_recording

Usage = namedtuple("Usage", "total used free")
IMAGE = TopicType("sensor_msgs/msg/Image")
LIMIT = 1_000_000


def noise(stamp_ns: int) -> Image:
    """An image that no compression makes small."""
    pixels = np.random.default_rng(stamp_ns).integers(0, 255, (120, 160, 3), np.uint8)
    return Image(pixels, "bgr8", Header(stamp_ns))


def write_all(recorder: Recorder, stamps_ns: Iterable[int]) -> None:
    for stamp_ns in stamps_ns:
        recorder.write("/a", noise(stamp_ns))


def count_in_bag(path: Path) -> int:
    with AnyReader([path]) as reader:
        return sum(1 for _ in reader.messages())


def count_in_cut_mcap(path: Path) -> int:
    count = 0
    with path.open("rb") as file:
        try:
            for record in StreamReader(file).records:
                count += isinstance(record, Message)
        except EndOfFile:
            return count
    raise AssertionError("the file is not cut")


def count_in_cut_bag(path: Path) -> int:
    recording = open_recording(path)
    count = sum(1 for _ in recording.read())
    recording.close()
    return count


def count_in_mp4(path: Path) -> int:
    with av.open(str(path)) as container:
        return sum(1 for _ in container.decode(video=0))


@pytest.mark.parametrize(
    ("suffix", "count"),
    [(".mcap", count_in_bag), (".bag", count_in_bag), (".mp4", count_in_mp4)],
    ids=["mcap", "bag", "mp4"],
)
def test_it_stops_while_there_is_room_to_finish(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, count
) -> None:
    path = tmp_path / f"r{suffix}"

    def disk_usage(folder: Path) -> Usage:
        assert folder == tmp_path
        return Usage(LIMIT, 0, LIMIT - path.stat().st_size)

    monkeypatch.setattr(shutil, "disk_usage", disk_usage)
    recorder = open_recorder(str(path), {"/a": IMAGE})
    images = iter(range(0, 10**12, 33_000_000))
    with pytest.raises(RecordingError) as error:
        write_all(recorder, images)
    recorder.close()
    kept = count(path)
    assert 5 < kept == next(images) // 33_000_000 - 1
    assert str(error.value) == (
        f"{path}: No space left on device; the first {kept} messages were kept"
    )
    assert LIMIT // 2 < path.stat().st_size < LIMIT


@pytest.mark.parametrize(
    ("total", "reserve", "said"),
    [(2**40, 2**30, "1 GiB"), (2**32, 2**32 // 20, "5%")],
    ids=["large", "small"],
)
@pytest.mark.parametrize(
    ("suffix", "count"),
    [(".mcap", count_in_bag), (".bag", count_in_bag), (".mp4", count_in_mp4), ("", count_in_bag)],
    ids=["mcap", "bag", "mp4", "folder"],
)
def test_a_running_graph_leaves_room_to_others(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    suffix: str,
    count,
    total: int,
    reserve: int,
    said: str,
) -> None:
    path = tmp_path / f"r{suffix}"

    def disk_usage(_: Path) -> Usage:
        written = sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file())
        return Usage(total, 0, reserve + LIMIT - written)

    monkeypatch.setattr(shutil, "disk_usage", disk_usage)
    recorder = open_recorder(str(path), {"/a": IMAGE})
    images = iter(range(0, 10**12, 33_000_000))
    with pytest.raises(RecordingError) as error:
        write_all(recorder, images)
    recorder.close()
    kept = count(path)
    assert 5 < kept == next(images) // 33_000_000 - 1
    assert f"its disk has less than {said} left; the first {kept} messages" in str(error.value)


def test_a_conversion_may_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(2**40, 0, 10**6))
    with open_recorder(f"{tmp_path}/r.mcap", {"/a": IMAGE}, live=False) as recorder:
        write_all(recorder, range(0, 10**10, 10**9))
    assert count_in_bag(recorder.path) == 10


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".mp4", ""])
def test_a_disk_that_was_full_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(LIMIT, LIMIT, 0))
    recorder = open_recorder(f"{tmp_path}/r{suffix}", {"/a": IMAGE})
    with pytest.raises(RecordingError, match=r"No space left on device; nothing was kept$"):
        recorder.write("/a", noise(0))
    recorder.close()
    assert not list(tmp_path.iterdir())


PROGRAM = f"""
import json, resource, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_full_disk import IMAGE, LIMIT, RecordingError, open_recorder, write_all

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))
errors = []
for path in sys.argv[1:]:
    recorder = open_recorder(path, {{"/a": IMAGE}})
    try:
        write_all(recorder, range(0, 10**12, 200_000_000))
    except RecordingError as error:
        errors.append(str(error))
    recorder.close()
    recorder.close()
print(json.dumps(errors))
"""


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """A folder of files whose writes failed at LIMIT bytes, and what was raised."""
    pytest.importorskip("resource", reason="only POSIX systems can limit the size of a file")
    folder = tmp_path_factory.mktemp("limited")
    paths = [str(folder / name) for name in ("r.mcap", "r.bag", "r.mp4")]
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM, *paths], stdout=subprocess.PIPE, check=True, timeout=60
    )
    return folder, json.loads(run.stdout)


@pytest.mark.parametrize(
    ("name", "count"),
    [("r.mcap", count_in_cut_mcap), ("r.bag", count_in_cut_bag), ("r.mp4", count_in_mp4)],
)
def test_a_write_that_fails_leaves_whole_messages(
    limited: tuple[Path, list[str]], name: str, count
) -> None:
    folder, errors = limited
    kept = count(folder / name)
    assert kept > 3
    expected = f"{folder / name}: File too large; the first {kept} messages were kept"
    assert expected in errors
    assert LIMIT // 2 < (folder / name).stat().st_size < LIMIT


UNBEGUN = f"""
import resource, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_full_disk import IMAGE, RecordingError, open_recorder

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
try:
    open_recorder(sys.argv[1], {{"/a": IMAGE}}, overwrite=True)
except RecordingError as error:
    sys.exit(str(error))
"""


@pytest.mark.parametrize("name", ["r.mcap", "r.bag", "r"])
@pytest.mark.parametrize("old", [False, True])
def test_one_that_cannot_be_begun_leaves_nothing(tmp_path: Path, name: str, old: bool) -> None:
    pytest.importorskip("resource", reason="only POSIX systems can limit the size of a file")
    if old:
        open_recorder(str(tmp_path / name), {"/a": IMAGE}).close()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    run = subprocess.run(
        [sys.executable, "-c", UNBEGUN, str(tmp_path / name)],
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    assert "File too large; nothing was kept" in run.stderr
    assert run.stderr.endswith(f"; {tmp_path / name} is unchanged\n") == old
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before
