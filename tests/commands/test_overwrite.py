"""What the commands may write over: nothing that is read, nothing twice, nothing half."""

import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import forked
import pytest
from rosbags.highlevel import AnyReader
from waiting import bytes_in, wait_for

from ros_visualise.commands import main
from ros_visualise.data import Header, Odometry
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.messages.recorded import TopicType
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.playback import Playback

COMMAND = [sys.executable, "-m", "ros_visualise"]
ODOM = TopicType("nav_msgs/msg/Odometry")
S = 10**9
ROUTE = ["--topic", "/odom"]


def record(target: Path, count: int = 50) -> Path:
    """A recording of a robot that drives straight on."""
    with open_recorder(str(target), {"/odom": ODOM}, live=False) as recorder:
        for number in range(count):
            place = [float(number), 0.0, 0.0]
            recorder.write("/odom", Odometry(place, [0, 0, 0, 1], header=Header(number * S)))
    return target


def count(path: Path) -> int:
    with AnyReader([path]) as reader:
        return sum(1 for _ in reader.messages())


def tree(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, and what is in it."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """Runs a command that must be refused by one line and leave all files as they were."""

    def refuse(*arguments: object) -> str:
        before = tree(tmp_path)
        assert main([str(one) for one in arguments]) == 2
        found = capsys.readouterr()
        assert found.out == ""
        (line,) = found.err.splitlines()
        assert tree(tmp_path) == before
        return line

    return refuse


PLAY = ["--view", "none", "--rate", "0", "--overwrite"]


def test_a_second_target_that_is_refused_leaves_the_first(refused: Any, tmp_path: Path) -> None:
    source = record(tmp_path / "in.bag")
    old = record(tmp_path / "old.mcap", 7)
    folder = record(tmp_path / "old", 7)
    (mine := tmp_path / "mine").mkdir()
    (mine / "notes.txt").write_text("precious")
    for second in ("mine", "gone/r.mcap", "r.avi", "r.mp4@/odom"):
        targets = ["--record", old, "--record", folder, "--record", tmp_path / second]
        refused("bag", source, *PLAY, *targets)
    assert count(folder) == 7


def test_the_recordings_of_others_in_a_folder_stay(refused: Any, tmp_path: Path) -> None:
    source = record(tmp_path / "in.bag")
    (others := tmp_path / "recs").mkdir()
    for name in ("one.mcap", "two.mcap", "three.db3"):
        record(tmp_path / "r.mcap").rename(others / name)
    assert "holds more than a ROS 2 bag" in refused("convert", source, others, "--overwrite")
    assert "holds more than a ROS 2 bag" in refused("bag", source, *PLAY, "--record", others)


def test_what_is_read_is_not_written(refused: Any, tmp_path: Path) -> None:
    bag, one = record(tmp_path / "in"), record(tmp_path / "in.mcap")
    (tmp_path / "hard.mcap").hardlink_to(one)
    (tmp_path / "soft.mcap").symlink_to(one)
    (tmp_path / "hard_0.mcap").hardlink_to(bag / "in_0.mcap")
    (tmp_path / "soft").symlink_to(bag)
    inside = bag / "in_0.mcap"
    pairs = [
        (one, one),
        (one, tmp_path / "in" / ".." / "in.mcap"),
        (one, tmp_path / "hard.mcap"),
        (one, tmp_path / "soft.mcap"),
        (tmp_path / "soft.mcap", one),
        (bag, bag),
        (bag, tmp_path / "soft"),
        (bag, inside),
        (bag, tmp_path / "hard_0.mcap"),
        (tmp_path / "soft", inside),
        (inside, bag),
    ]
    for source, target in pairs:
        for line in (
            refused("convert", source, target, "--overwrite"),
            refused("bag", source, *PLAY, "--record", target),
            refused("trajectory", source, target, *ROUTE, "--overwrite"),
            refused("trajectory", source, tmp_path / "new", "--plot", target, "--overwrite"),
        ):
            assert f"{target}: in use as the source, or a part of it" in line


def test_a_target_that_names_topics_is_compared_too(refused: Any, tmp_path: Path) -> None:
    one = record(tmp_path / "in.mcap")
    assert "in use" in refused("convert", one, f"{one}@/odom", "--overwrite")


@pytest.mark.parametrize("end", ["-wal", "-journal", "-shm"])
def test_what_a_database_has_beside_it_is_not_written(
    refused: Any, recordings: Path, tmp_path: Path, end: str
) -> None:
    whole = recordings / "bags" / "plotjuggler_rosbag2_test" / "rosbag2_test_0.db3"
    source = shutil.copy(whole, tmp_path / "w.db3")
    (away := tmp_path / "away").mkdir()
    (away / "soft.db3").symlink_to(source)
    (target := tmp_path / f"w.db3{end}").write_bytes(b"messages")
    for read in (source, away / "soft.db3", tmp_path):
        assert "in use" in refused("trajectory", read, target, "--overwrite")


def test_no_file_of_a_folder_is_written(refused: Any, recordings: Path, tmp_path: Path) -> None:
    split = shutil.copytree(recordings / "bags" / "evo_tf_example", tmp_path / "split")
    drive = recordings / "kitti" / "drive0009_f000-004" / "2011_09_26"
    day = shutil.copytree(drive, tmp_path / "day", ignore=shutil.ignore_patterns("*.png", "*.bin"))
    (sync,) = (path for path in day.iterdir() if path.is_dir())
    (link := tmp_path / "link").symlink_to(sync)
    for source, target in [
        (split, split / "tf_example.db3"),
        (split / "tf_example.db3", split / "metadata.yaml"),
        (sync, day / "calib_velo_to_cam.txt"),
        (sync, sync / "oxts" / "data" / "0000000000.txt"),
        (day, sync / "oxts" / "timestamps.txt"),
        (link, day / "calib_velo_to_cam.txt"),
    ]:
        assert target.exists()
        assert "in use" in refused("trajectory", source, target, "--overwrite")


def test_two_results_are_not_one(refused: Any, tmp_path: Path) -> None:
    source, old = record(tmp_path / "in.bag"), record(tmp_path / "old.mcap")
    (tmp_path / "link.mcap").hardlink_to(old)
    same = ["--record", old, "--record", tmp_path / "link.mcap"]
    assert "already in use" in refused("bag", source, *PLAY, *same)
    new = ["--record", tmp_path / "new.mcap", "--record", tmp_path / "." / "new.mcap"]
    assert "already in use" in refused("bag", source, *PLAY, *new)
    picture = ["--plot", tmp_path / "old.mcap", "--overwrite"]
    assert "already in use" in refused("trajectory", source, old, *picture)


@pytest.mark.parametrize("name", ["a\nb.mcap", "a\x1b[31m.mcap", "a\0.mcap", "\udcff.mcap", "a\r"])
def test_names_that_no_line_can_show(refused: Any, tmp_path: Path, name: str) -> None:
    source = record(tmp_path / "in.bag")
    for line in (
        refused("convert", source, tmp_path / name),
        refused("bag", source, *PLAY, "--record", tmp_path / name),
        refused("trajectory", source, tmp_path / name),
        refused("trajectory", source, tmp_path / "r.tum", "--plot", tmp_path / name),
    ):
        assert line.isprintable()
        assert "contains control characters; choose another name" in line


def test_names_that_are_too_long(refused: Any, tmp_path: Path) -> None:
    source = record(tmp_path / "in.bag")
    for name in ("x" * 300, "x" * 300 + ".mcap", "y" * 300 + "/r.mcap", "z/" * 3000 + "r.mcap"):
        for line in (
            refused("convert", source, tmp_path / name),
            refused("bag", source, *PLAY, "--record", tmp_path / name),
            refused("trajectory", source, tmp_path / name),
        ):
            assert "File name too long" in line


class TestFullDisk:
    """As on a full disk: no file of this process may grow beyond a limit."""

    def run(self, limit: int, *arguments: object) -> subprocess.CompletedProcess[str]:
        def limit_files() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        return subprocess.run(
            [*COMMAND, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=60,
            preexec_fn=limit_files,
        )

    def test_a_trajectory_keeps_the_old_one_and_its_picture(self, tmp_path: Path) -> None:
        source = record(tmp_path / "in.bag", 500)
        out, plot = tmp_path / "out.tum", tmp_path / "out.svg"
        command = ["trajectory", source, out, *ROUTE, "--plot", plot, "--overwrite"]
        for file in (out, plot):
            file.write_text("precious")
        before = tree(tmp_path)
        assert main([str(one) for one in command]) == 0
        lengths = sorted(len(file.read_bytes()) for file in (out, plot))
        assert lengths[0] > len("precious")
        for file in (out, plot):
            file.write_text("precious")
        for limit in (1000, (lengths[0] + lengths[1]) // 2):
            done = self.run(limit, *command)
            assert done.returncode == 1
            (line,) = done.stderr.splitlines()
            assert "File too large; nothing was written" in line
            assert tree(tmp_path) == before

    def test_a_conversion_keeps_the_old_one(self, tmp_path: Path) -> None:
        source, old = record(tmp_path / "in.bag", 5000), record(tmp_path / "old.bag", 7)
        done = self.run(1_000_000, "convert", source, old, "--overwrite")
        assert done.returncode == 1
        assert count(old) == 7
        part = tmp_path / "old.part.bag"
        assert f"messages were kept in {part}; {old} is unchanged" in done.stderr
        assert main(["convert", str(part), str(tmp_path / "rescued.bag")]) in (0, 1)
        assert 0 < count(tmp_path / "rescued.bag") < 5000


def interrupt(target: Path, *arguments: object) -> tuple[int, str]:
    """Run a command, end it by Ctrl-C when it has begun to write; its status and what it said."""
    with forked.Forked(
        [*COMMAND, *map(str, arguments)], stderr=subprocess.PIPE, text=True
    ) as process:
        wait_for(lambda: bytes_in(target) > 10_000, "a message", process=process)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=30)
    return process.returncode, error


def test_a_conversion_that_is_interrupted_keeps_the_old_one(tmp_path: Path) -> None:
    source, old = record(tmp_path / "in.bag", 30_000), record(tmp_path / "old.mcap", 7)
    part = tmp_path / "old.part.mcap"
    status, said = interrupt(part, "convert", source, old, "--overwrite", "--compression", "zstd")
    assert status == 130
    assert count(old) == 7
    assert f"{old} unchanged; partial output in {part}" in said
    assert 0 < count(part) < 30_000


def test_a_run_that_is_interrupted_is_whole(tmp_path: Path) -> None:
    old = record(tmp_path / "old.mcap", 7)
    part = tmp_path / "old.part.mcap"
    play = ["demo", "landscape", "--view", "none", "--record", old, "--overwrite"]
    status, said = interrupt(part, *play)
    assert status == 130
    assert f"{old}: " in said
    assert not part.exists()
    with AnyReader([old]) as reader:
        assert "/edges" in reader.topics
        assert reader.message_count > 0


def test_a_run_without_messages_replaces_nothing(tmp_path: Path) -> None:
    old = record(tmp_path / "old.mcap", 7)
    runtime = LocalRuntime(image_pipeline("landscape"), Playback())
    runtime.start_recording(old, overwrite=True)
    runtime.stop()
    assert count(old) == 7


@pytest.mark.parametrize("name", ["r.mcap", "r.bag", "r.mp4", "r"])
def test_the_folder_is_removed_while_it_is_recorded(tmp_path: Path, name: str) -> None:
    (folder := tmp_path / "folder").mkdir()
    play = ["demo", "landscape", "--view", "none", "--record", folder / name]
    with forked.Forked([*COMMAND, *map(str, play)], stderr=subprocess.PIPE, text=True) as process:
        wait_for(lambda: bytes_in(folder) > 10_000, "a message", process=process)
        shutil.rmtree(folder)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 1
    (line,) = (line for line in error.splitlines() if "moved or removed" in line)
    assert line.endswith("moved or removed while it was being written; nothing was kept")
    assert "Traceback" not in error


def test_a_converted_folder_is_removed(tmp_path: Path) -> None:
    source = record(tmp_path / "in.bag", 30_000)
    (folder := tmp_path / "folder").mkdir()
    with forked.Forked(
        [*COMMAND, "convert", str(source), str(folder / "r")], stderr=subprocess.PIPE, text=True
    ) as process:
        wait_for(lambda: bytes_in(folder) > 10_000, "a message", process=process)
        shutil.rmtree(folder)
        _, error = process.communicate(timeout=60)
    assert process.returncode == 1
    (line,) = error.splitlines()
    assert "moved or removed" in line
