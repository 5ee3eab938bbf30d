"""Calibration, times and poses that are cut off or changed: what they cost is said, and counts."""

import json
import os

import pytest
from kitti_reading import messages, replace_file

from ros_visualise.commands import main

FRAMES = [f"cam{number:02d}_optical" for number in range(4)]
SPOILS = {
    "emptied": lambda data: b"",
    "cut": lambda data: data[: len(data) // 4],
    "one digit short": lambda data: data[:-2],
    "without its last line": lambda data: data[: data[:-1].rindex(b"\n") + 1],
    "no numbers": lambda data: b"nan".join(data.rsplit(b"9.", 1)),
    "a number too few": lambda data: data[:-1].rpartition(b" ")[0] + b"\n",
    "a number too many": lambda data: data[:-1] + b" 1.0\n",
    "zeros": lambda data: bytes(len(data)),
    "other words": lambda data: b"\xff\xfe not found\n" * 20,
}


def children(recording):
    return {one.child_frame_id for one in messages(recording, "/tf_static")[0].transforms}


def spoil_row(path, name, change):
    """Change the numbers of one row."""
    lines = path.read_text().splitlines()
    rows = [name + ":" + change(line) if line.startswith(f"{name}:") else line for line in lines]
    replace_file(path, "\n".join(filter(None, rows)).encode() + b"\n")


@pytest.mark.parametrize("spoil", SPOILS.values(), ids=SPOILS)
def test_a_damaged_place_of_the_scanner_is_said(opened, changeable, spoil):
    path = changeable.parent / "calib_imu_to_velo.txt"
    replace_file(path, spoil(path.read_bytes()))
    recording = opened(changeable)
    assert children(recording) == {"odom", "imu_link", *FRAMES}
    (note,) = recording.loss.notes
    assert note.startswith("../calib_imu_to_velo.txt: ")
    assert note.endswith("missing or damaged; skipped: imu_link -> velodyne")
    assert not recording.notes


@pytest.mark.parametrize("name", ["R", "T"])
@pytest.mark.parametrize("change", [lambda row: "", lambda row: row[:30], lambda row: " 0" * 9])
def test_a_damaged_place_of_the_cameras_is_said(opened, changeable, name, change):
    spoil_row(changeable.parent / "calib_velo_to_cam.txt", name, change)
    recording = opened(changeable)
    assert children(recording) == {"odom", "imu_link", "velodyne"}
    assert "/cam03/camera_info" in recording.topics
    (note,) = recording.loss.notes
    said = f"../calib_velo_to_cam.txt: {name} is missing or damaged; skipped: {', '.join(FRAMES)}"
    assert note == said


@pytest.mark.parametrize(
    ("name", "left_out", "count"),
    [
        ("P_rect_02", "/cam02/camera_info, cam02_optical", 5),
        ("S_rect_01", "/cam01/camera_info", 5),
        ("R_rect_00", ", ".join(FRAMES), 0),
    ],
)
@pytest.mark.parametrize("change", [lambda row: row[:20], lambda row: " nan" * 12])
def test_a_damaged_camera_is_said(opened, changeable, name, left_out, count, change):
    spoil_row(changeable.parent / "calib_cam_to_cam.txt", name, change)
    recording = opened(changeable)
    infos = [topic for topic in recording.topics if topic.endswith("camera_info")]
    assert len(infos) == 4 - bool(count)
    assert len(messages(recording, "/cam02/image_rect")) == 5
    (note,) = recording.loss.notes
    said = f"../calib_cam_to_cam.txt: {name} is missing or damaged; skipped: {left_out}"
    assert note == said
    assert recording.loss.messages == count


def test_an_emptied_file_of_the_cameras_costs_all_of_them(opened, changeable):
    replace_file(changeable.parent / "calib_cam_to_cam.txt", b"")
    recording = opened(changeable)
    assert recording.loss.messages == 20
    (note,) = recording.loss.notes
    assert note.startswith("../calib_cam_to_cam.txt: P_rect_00 and 8 more are missing or damaged; ")
    assert "/cam00/camera_info, cam00_optical, " in note


def test_a_file_that_may_not_be_read_is_said(opened, changeable):
    path = changeable.parent / "calib_imu_to_velo.txt"
    path.unlink()
    path.mkdir()
    (note,) = opened(changeable).loss.notes
    assert note == "../calib_imu_to_velo.txt: Is a directory; skipped: imu_link -> velodyne"


def test_a_folder_that_may_not_be_read_is_said(opened, changeable, monkeypatch):
    """The tests may be run by somebody who may read everything."""
    closed = changeable / "image_03/data"
    scandir, access = os.scandir, os.access

    def refuse(path):
        if path == closed:
            raise PermissionError
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refuse)
    monkeypatch.setattr(os, "access", lambda path, mode: path != closed and access(path, mode))
    recording = opened(changeable)
    assert recording.loss.notes == ["image_03/data: permission denied; try chmod u+rX"]
    assert not recording.notes


def test_what_nobody_asks_for_may_be_damaged(opened, changeable):
    spoil_row(changeable.parent / "calib_cam_to_cam.txt", "T_02", lambda row: row[:9])
    assert not opened(changeable).loss


@pytest.mark.parametrize("what", ["start", "end"])
@pytest.mark.parametrize(("kept", "lost"), [(0, 5), (40, 4), (145, 1), (-1, 0)])
def test_turns_without_their_times_are_said(opened, changeable, what, kept, lost):
    path = changeable / f"velodyne_points/timestamps_{what}.txt"
    replace_file(path, path.read_bytes()[:kept])
    recording = opened(changeable)
    topic = f"/velodyne_points/scan_{what}"
    assert len(messages(recording, topic)) == 5 - lost
    assert recording.loss.messages == lost
    said = f"{lost} of 5 times are missing or damaged; their messages on {topic} skipped"
    expected = [f"velodyne_points/timestamps_{what}.txt: {said}"] if lost else []
    assert recording.loss.notes == expected


@pytest.mark.parametrize("part", ["oxts", "velodyne_points", "image_03"])
@pytest.mark.parametrize("kept", [0, 70, 148])
def test_times_that_are_cut_off_are_said(opened, changeable, part, kept):
    path = changeable / part / "timestamps.txt"
    whole = {topic: len(stamps) for topic, stamps in opened(changeable).stamps_ns().items()}
    replace_file(path, path.read_bytes()[:kept])
    recording = opened(changeable)
    assert {topic: len(stamps) for topic, stamps in recording.stamps_ns().items()} == whole
    (note,) = recording.loss.notes
    assert note.startswith(f"{part}/timestamps.txt: {5 - kept // 30} of 5 times are missing or")


@pytest.mark.parametrize("command", ["info", "convert", "trajectory", "kitti"])
def test_commands_say_it_once_and_exit_with_1(changeable, tmp_path, capsys, caplog, command):
    path = changeable.parent / "calib_imu_to_velo.txt"
    targets = {"convert": [tmp_path / "r.mcap"], "trajectory": [tmp_path / "r.tum"]}
    options = ["--view", "none", "--rate", "0"] if command == "kitti" else []
    arguments = [command, changeable, *targets.get(command, []), *options]
    replace_file(path, path.read_bytes()[:100])
    assert main([*map(str, arguments)]) == 1
    told = capsys.readouterr()
    said = told.out + told.err + caplog.text
    assert said.count("../calib_imu_to_velo.txt: R and 1 more are missing or damaged") == 1
    path.unlink()
    for target in targets.get(command, []):
        target.unlink()
    assert main([*map(str, arguments)]) == 0  # what it lacks is no loss
    assert "no calib_imu_to_velo.txt" in caplog.text


def test_info_counts_it(changeable, capsys):
    replace_file(changeable.parent / "calib_cam_to_cam.txt", b"")
    assert main(["info", str(changeable), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["lost"]["messages"] == 20
