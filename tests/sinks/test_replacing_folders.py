"""Of folders only a ROS 2 bag with nothing beside it is replaced."""

import logging
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from test_full_disk import noise
from test_replacing import TOPICS, content, count, record

from ros_visualise.core.errors import OpenError, RecordingError
from ros_visualise.sinks import open_recorder


@pytest.fixture
def others(tmp_path: Path) -> Path:
    """A folder of recordings by somebody else."""
    (folder := tmp_path / "recs").mkdir()
    for name in ("one.mcap", "two.mcap", "three.mcap"):
        record(folder / name, 0, 1)
    return folder


def refused(folder: Path) -> None:
    before = content(folder)
    with pytest.raises(OpenError, match="holds more than a ROS 2 bag; choose another name"):
        open_recorder(str(folder), TOPICS, overwrite=True)
    assert content(folder) == before
    assert not folder.with_name(f"{folder.name}.part").exists()


def test_recordings_of_others_stay(others: Path) -> None:
    refused(others)


def test_metadata_that_does_not_list_all(others: Path, tmp_path: Path) -> None:
    record(tmp_path / "r", 0)
    shutil.copy(tmp_path / "r" / "metadata.yaml", others)
    refused(others)
    for file in others.glob("*.mcap"):
        file.unlink()
    refused(others)
    record(others / "r_0.mcap", 0)
    record(others, 0, 1, 2, overwrite=True)
    assert count(others) == 3


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "text",
    [
        "no metadata",
        "[" * 5_000,
        "".join(f"a{i}: &a{i} {{<<: [*a{i - 1}, *a{i - 1}]}}\n" for i in range(1, 30)),
    ],
    ids=["text", "deep", "aliases"],
)
def test_metadata_that_means_nothing(tmp_path: Path, text: str) -> None:
    record(folder := tmp_path / "r", 0)
    (folder / "metadata.yaml").write_text(text.replace("*a0", "&a0 {}", 1))
    refused(folder)


def test_what_a_killed_recorder_leaves_is_replaced(tmp_path: Path) -> None:
    record(folder := tmp_path / "r", 0)
    (folder / "metadata.yaml").unlink()
    record(folder, 0, 1, overwrite=True)
    assert count(folder) == 2


def test_a_split_bag_is_replaced(recordings: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(recordings / "bags" / "evo_tf_example", tmp_path / "r")
    record(folder, 0, 1, overwrite=True)
    assert sorted(content(folder)) == ["metadata.yaml", "r_0.mcap"]


def test_what_comes_while_it_is_written_stays(tmp_path: Path) -> None:
    record(folder := tmp_path / "r", 0)
    recorder = open_recorder(str(folder), TOPICS, overwrite=True)
    recorder.write("/a", noise(0))
    (folder / "notes.txt").write_text("precious")
    with pytest.raises(RecordingError, match="was changed in the meantime") as error:
        recorder.close()
    assert f"kept in {folder}.part; {folder} is unchanged" in str(error.value)
    assert sorted(content(folder)) == ["metadata.yaml", "notes.txt", "r_0.mcap"]
    with AnyReader([tmp_path / "r.part"]) as reader:
        assert reader.message_count == 1


@pytest.mark.parametrize(
    "files",
    [
        {"thesis.tex": b"t", "photos.zip": b"PK"},
        {"thesis.mcap": b"precious"},
        {"photos.db3": b"precious"},
        {"photos.mcap.zstd": b"precious"},
        {"photos.zstd": b"\x28\xb5\x2f\xfd"},
        {"empty.mcap": b""},
    ],
    ids=lambda files: next(iter(files)),
)
def test_a_list_of_what_is_no_bag(tmp_path: Path, files: dict[str, bytes]) -> None:
    (folder := tmp_path / "r").mkdir()
    for name, data in files.items():
        (folder / name).write_bytes(data)
    names = ", ".join(files)
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  relative_file_paths: [{names}]\n"
    )
    refused(folder)


def test_a_file_that_is_only_called_so(tmp_path: Path) -> None:
    (folder := tmp_path / "r").mkdir()
    (folder / "r_0.mcap").write_bytes(b"some foreign data")
    refused(folder)


def test_packed_files_are_replaced(tmp_path: Path) -> None:
    record(folder := tmp_path / "r", 0)
    (folder / "r_0.mcap").unlink()
    for name in ("r_0.mcap.zstd", "r_1.db3.zstd"):
        (folder / name).write_bytes(b"\x28\xb5\x2f\xfd")
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {relative_file_paths: [r_0.mcap.zstd, r_1.db3.zstd]}"
    )
    record(folder, 0, 1, overwrite=True)
    assert count(folder) == 2


def test_what_comes_while_it_is_replaced_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    record(folder := tmp_path / "r", 0)
    rename = os.rename

    def put_into(old: Path, new: Path) -> None:
        rename(old, new)
        if old == folder:
            (new / "notes.txt").write_text("precious")

    monkeypatch.setattr(os, "rename", put_into)
    with caplog.at_level(logging.WARNING):
        record(folder, 0, 1, overwrite=True)
    assert count(folder) == 2
    (aside,) = tmp_path.glob("r.old-*")
    assert content(aside) == {"notes.txt": b"precious"}
    assert f"{aside} is kept" in caplog.text


KILLED = """
import os, signal, sys
from test_replacing import record
from pathlib import Path
made, rename = int(sys.argv[2]), os.rename

def killed_after(old, new):
    global made
    rename(old, new)
    made -= 1
    if not made:
        os.kill(os.getpid(), signal.SIGKILL)

os.rename = killed_after
record(Path(sys.argv[1]), 0, 1, overwrite=True)
"""


@pytest.mark.parametrize("renames", [1, 2])
def test_what_a_kill_left_aside_is_told_at_the_next_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, renames: int
) -> None:
    record(folder := tmp_path / "r", 0)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    command = [sys.executable, "-c", KILLED, str(folder), str(renames)]
    assert subprocess.run(command, env=environment, timeout=60).returncode == -signal.SIGKILL
    (aside,) = tmp_path.glob("r.old-*")
    assert count(aside) == 1
    assert folder.exists() == (renames == 2)
    record(folder, 0, 1, 2, overwrite=True)
    assert [record.getMessage() for record in caplog.records if str(aside) in record.message] == [
        f"{aside} is the old {folder}, left by a killed run; rename it to restore it, or delete it"
    ]
    assert count(folder) == 3
    assert count(aside) == 1


def test_rights_stay_as_they_were(tmp_path: Path) -> None:
    record(folder := tmp_path / "r", 0)
    folder.chmod(0o750)
    (folder / "r_0.mcap").chmod(0o600)
    with open_recorder(str(folder), TOPICS, overwrite=True) as recorder:
        recorder.write("/a", noise(0))
        assert recorder.path.stat().st_mode & 0o777 == 0o700
    assert folder.stat().st_mode & 0o777 == 0o750
    assert {file.stat().st_mode & 0o777 for file in folder.iterdir()} == {0o600}
