"""What is there is replaced by what is whole, and by nothing less."""

import os
import shutil
import signal
import subprocess
import sys
from collections import namedtuple
from contextlib import closing
from pathlib import Path

import pytest
from test_full_disk import IMAGE, count_in_bag, count_in_mp4, noise, write_all

from ros_visualise.core.errors import OpenError, RecordingError
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.opening import open_recording

TOPICS = {"/a": IMAGE}
NAMES = ["r.mcap", "r.bag", "r.mp4", "r"]
Usage = namedtuple("Usage", "total used free")


def record(target: Path, *seconds: int, overwrite: bool = False) -> None:
    with open_recorder(str(target), TOPICS, overwrite) as recorder:
        for second in seconds:
            recorder.write("/a", noise(second * 10**9))


def count(path: Path) -> int:
    """By readers that are not ours."""
    return count_in_mp4(path) if path.suffix == ".mp4" else count_in_bag(path)


def count_unfinished(path: Path) -> int:
    if path.suffix == ".mp4":
        return count_in_mp4(path)
    with closing(open_recording(path)) as recording:
        return sum(1 for _ in recording.read())


def content(path: Path) -> dict[str, bytes]:
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


@pytest.fixture(params=NAMES)
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A recording of two images."""
    record(tmp_path / request.param, 0, 1)
    return tmp_path / request.param


def beside(old: Path) -> Path:
    return old.with_name(f"r.part{old.suffix}")


def test_the_old_one_goes_when_the_new_one_is_whole(old: Path) -> None:
    before = content(old)
    with open_recorder(str(old), TOPICS, overwrite=True) as recorder:
        for second in range(5):
            recorder.write("/a", noise(second * 10**9))
            assert content(old) == before
            assert recorder.path == beside(old)
    assert recorder.path == old
    assert count(old) == 5
    assert list(old.parent.iterdir()) == [old]


@pytest.mark.parametrize("name", NAMES[:3])
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666])
def test_rights_stay_as_they_were(tmp_path: Path, name: str, mode: int) -> None:
    record(old := tmp_path / name, 0)
    old.chmod(mode)
    with open_recorder(str(old), TOPICS, overwrite=True) as recorder:
        assert beside(old).stat().st_mode & 0o777 == mode
        recorder.write("/a", noise(0))
    assert old.stat().st_mode & 0o777 == mode


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")
def test_the_owner_stays(tmp_path: Path) -> None:
    record(old := tmp_path / "r.mcap", 0)
    os.chown(old, 1234, 1235)
    record(old, 0, 1, overwrite=True)
    assert (old.stat().st_uid, old.stat().st_gid) == (1234, 1235)


def test_a_link_stays_a_link(old: Path, tmp_path: Path) -> None:
    (away := tmp_path / "away").mkdir()
    there = old.rename(away / old.name)
    old.symlink_to(there)
    record(old, 0, 1, 2, overwrite=True)
    assert old.is_symlink()
    assert count(there) == 3
    assert list(away.iterdir()) == [there]


def test_what_has_the_name_by_now_stays(old: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / old.name
    other.parent.mkdir()
    record(other, 0, 1, 2, 3)
    recorder = open_recorder(str(old), TOPICS, overwrite=True)
    recorder.write("/a", noise(0))
    old.rename(tmp_path / "away")
    other.rename(old)
    with pytest.raises(
        RecordingError, match="the existing file or folder was replaced in the meantime"
    ):
        recorder.close()
    assert count(old) == 4
    assert count(beside(old)) == 1


def test_what_was_removed_meanwhile_is_not_missed(old: Path, tmp_path: Path) -> None:
    recorder = open_recorder(str(old), TOPICS, overwrite=True)
    recorder.write("/a", noise(0))
    old.rename(tmp_path / "away")
    recorder.close()
    assert count(old) == 1
    assert not beside(old).exists()


def test_a_disk_that_fills_up_leaves_the_old_one(
    old: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = content(old)
    recorder = open_recorder(str(old), TOPICS, overwrite=True)
    for second in range(3):
        recorder.write("/a", noise(second * 10**9))
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 0))
    with pytest.raises(RecordingError) as error:
        write_all(recorder, range(3 * 10**9, 9 * 10**9, 10**9))
    recorder.close()
    assert content(old) == before
    kept = count(beside(old))
    assert kept >= 3
    said = str(error.value)
    assert f"No space left on device; the first {kept} messages were kept" in said
    assert str(beside(old)) in said
    assert said.endswith(f"; {old} is unchanged")


def test_one_that_is_full_at_once_leaves_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(old := tmp_path / "r.mcap", 0, 1)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**9, 10**9, 0))
    with pytest.raises(RecordingError, match=r"No space left on device; .*r\.mcap is unchanged"):
        record(old, 0, overwrite=True)
    assert count(old) == 2
    assert list(tmp_path.iterdir()) == [old]


def test_work_that_fails_leaves_the_old_one(old: Path) -> None:
    before = content(old)

    def fail() -> None:
        with open_recorder(str(old), TOPICS, overwrite=True) as recorder:
            recorder.write("/a", noise(0))
            raise ValueError("a fault of the program")

    with pytest.raises(ValueError, match="a fault of the program"):
        fail()
    assert content(old) == before
    assert count(beside(old)) == 1


RECORD = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from {Path(__file__).stem} import TOPICS, noise, open_recorder

recorder = open_recorder(sys.argv[1], TOPICS, overwrite=True)
for number in range(10**9):
    recorder.write("/a", noise(number * 100_000_000))
    print(number, flush=True)
"""


def start(target: Path) -> subprocess.Popen[str]:
    """A process that records for ever; of an .mp4 some seconds, which are what can be read."""
    process = subprocess.Popen(
        [sys.executable, "-c", RECORD, str(target)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    while process.stdout.readline() != "40\n":
        assert process.poll() is None
    return process


def test_a_second_process_is_refused_and_a_killed_one_leaves_both(old: Path) -> None:
    before = content(old)
    with start(old) as process:
        with pytest.raises(OpenError, match="another process is recording to it; choose another"):
            open_recorder(str(old), TOPICS, overwrite=True)
        process.kill()
    assert content(old) == before
    salvage = content(beside(old))
    assert count_unfinished(beside(old)) > 30

    record(old, 0, 1, 2, overwrite=True)
    assert count(old) == 3
    assert content(beside(old)) == salvage
    assert set(old.parent.iterdir()) == {old, beside(old)}


@pytest.mark.parametrize("name", NAMES)
def test_a_new_one_is_locked_too(tmp_path: Path, name: str) -> None:
    with start(target := tmp_path / name) as process:
        with pytest.raises(OpenError, match="another process is recording to it"):
            open_recorder(str(target), TOPICS, overwrite=True)
        process.kill()
    record(target, 0, 1, overwrite=True)
    assert count(target) == 2


def test_what_may_not_be_written_is_not_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(old := tmp_path / "r.bag", 0)
    monkeypatch.setattr(os, "access", lambda path, mode: path != old)
    with pytest.raises(OpenError, match=r"r\.bag: cannot be written: Permission denied"):
        open_recorder(str(old), TOPICS, overwrite=True)
    assert list(tmp_path.iterdir()) == [old]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("late", [False, True])
def test_a_folder_that_is_removed_ends_it(tmp_path: Path, name: str, late: bool) -> None:
    (folder := tmp_path / "folder").mkdir()
    target = folder / name
    recorder = open_recorder(str(target), TOPICS)
    recorder.write("/a", noise(0))
    shutil.rmtree(folder)
    with pytest.raises(RecordingError) as error:
        recorder.close() if late else write_all(recorder, range(0, 9 * 10**9, 10**9))
    recorder.close()
    assert str(error.value).startswith(str(target))
    assert str(error.value).endswith(
        "moved or removed while it was being written; nothing was kept"
    )


def test_a_kill_at_any_moment_leaves_the_old_or_the_new_one(tmp_path: Path) -> None:
    """Each process replaces the file again and again; there is a whole one at any time."""
    program = RECORD[: RECORD.index("recorder =")] + (
        "from itertools import count\n"
        "for number in count():\n"
        "    with open_recorder(sys.argv[1], TOPICS, overwrite=True) as recorder:\n"
        "        recorder.write('/a', noise(number))\n"
        "    print(number, flush=True)\n"
    )
    record(old := tmp_path / "r.mcap", 0)
    for round_number in range(2):
        with subprocess.Popen(
            [sys.executable, "-c", program, str(old)], stdout=subprocess.PIPE, text=True
        ) as process:
            assert process.stdout is not None
            for _ in range(3 + round_number):
                process.stdout.readline()
                assert count(old) == 1
            process.send_signal(signal.SIGKILL)
        assert count(old) == 1
