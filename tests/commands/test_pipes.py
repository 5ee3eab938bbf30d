"""Pipes that nobody writes to, where commands look for files: no command waits for them."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from made_videos import numbered, write_video

from ros_visualise.core.errors import UsageError
from ros_visualise.ui.file_chooser import FileChooser

QUICK = ["--view", "none", "--rate", "0"]


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_video(tmp_path / "film.mkv", numbered(3))


@pytest.mark.parametrize(
    "line",
    [
        "info x.bag",
        "bag x.mcap",
        "bag x.ulg",
        "video x.mkv",
        "convert x.bag out.mcap",
        "explain canny x.jpg --export out",
        "trajectory x.tum",
        "landmarks x.jpg",
        "video film.mkv --params x.yaml",
        "video film.mkv --layout x.yaml",
        "video film.mkv --set streamer.camera_info_url=x.yaml",
        "video film.mkv --node tag_detector --set tag_detector.tags=x.yaml",
        "video film.mkv --node x.py:mine",
        "sim husky --mission x.yaml",
    ],
)
def test_a_pipe_in_place_of_a_file_is_refused(run, film, tmp_path, monkeypatch, line):
    monkeypatch.chdir(tmp_path)
    [pipe] = [word.rpartition("=")[2] for word in line.split() if "x." in word]
    os.mkfifo(pipe.partition(":")[0])
    command, *rest = line.split()
    options = QUICK if command in ("bag", "video", "sim") else []
    status, said = run(command, *rest, *options)
    assert status == 2
    [line] = said.strip().splitlines()
    assert "x." in line
    assert not (tmp_path / "out").exists()


def test_pipes_beside_a_database_and_a_film_are_not_waited_for(run, film, recordings, tmp_path):
    [database] = (recordings / "bags" / "evo_tf_example").glob("*.db3")
    (bag := tmp_path / "bag").mkdir()
    shutil.copyfile(database, bag / "x.db3")
    for name in ("x.db3-wal", "x.db3-journal", "y.mcap"):
        os.mkfifo(bag / name)
    os.mkfifo(film.with_suffix(".SRT"))
    assert run("bag", bag, *QUICK)[0] == 0
    assert run("video", film, *QUICK)[0] == 0


def test_pipes_in_a_bag_and_a_drive_are_damage(run, recordings, tmp_path, caplog):
    bag = tmp_path / "bag"
    shutil.copytree(recordings / "bags" / "evo_tf_example", bag, copy_function=shutil.copyfile)
    bag.chmod(0o755)
    _replace_by_pipe(bag / "metadata.yaml")
    date = tmp_path / "2011_09_26"
    shutil.copytree(
        recordings / "kitti" / "drive0009_f000-004" / "2011_09_26", date, copy_function=os.symlink
    )
    for folder in (date, *date.rglob("*")):
        if folder.is_dir():
            folder.chmod(0o755)
    for name in ("calib_cam_to_cam.txt", "2011_09_26_drive_0009_sync/oxts/timestamps.txt"):
        _replace_by_pipe(date / name)
    _replace_by_pipe(next(date.glob("*/image_00/data/*.png")))
    assert run("bag", bag, *QUICK)[0] == 1
    assert "metadata.yaml: cannot be read" in caplog.text
    assert run("kitti", date, *QUICK)[0] == 1
    assert "calib_cam_to_cam.txt: not a regular file" in caplog.text
    assert "image_00: 1 of 5 frames are missing" in caplog.text
    assert "oxts/timestamps.txt: 5 of 5 times are missing or damaged" in caplog.text


def test_a_page_offers_no_pipe(tmp_path):
    os.mkfifo(tmp_path / "x.bag")
    (tmp_path / "y.bag").touch()
    shelf = FileChooser(tmp_path, tmp_path)
    assert list(shelf.files()) == ["y.bag"]
    with pytest.raises(UsageError):
        shelf.ask(tmp_path / "x.bag")


def _replace_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)
