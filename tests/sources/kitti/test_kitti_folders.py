"""Which paths are taken, and folders that lack something."""

import shutil

import numpy as np
import pytest
from kitti_reading import fixed_transform, messages, replace_file

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.kitti import is_kitti, open_kitti
from ros_visualise.sources.opening import open_recording

MS = 1_000_000


def test_drive_is_found_from_above(opened, drive_0009):
    for path in (drive_0009, drive_0009.parent, drive_0009.parents[1]):
        assert is_kitti(path)
        assert opened(path).path == drive_0009


def test_one_of_several_drives_must_be_chosen(drive_0009):
    folder = drive_0009.parents[2]
    assert is_kitti(folder)
    with pytest.raises(OpenError, match=r"0009_sync, .*0052_sync; choose one, .* /.*_sync$"):
        open_kitti(folder)


def test_other_folders_are_not_kittis(tmp_path):
    (tmp_path / "image_00").mkdir()
    (tmp_path / "notes.txt").write_text("nothing here")
    for path in (tmp_path, tmp_path / "notes.txt", tmp_path / "absent"):
        assert not is_kitti(path)
        with pytest.raises(OpenError, match="not a KITTI drive"):
            open_kitti(path)


def test_drive_without_frames_is_refused(tmp_path):
    (tmp_path / "oxts/data").mkdir(parents=True)
    with pytest.raises(OpenError, match="no readable frames"):
        open_kitti(tmp_path)


def test_numbers_may_begin_anywhere(opened, changeable, drive_0009):
    """Of a part that was cut out with its lists of times."""
    for path in changeable.glob("*/data/*"):
        path.rename(path.with_stem(f"{int(path.stem) + 100:010d}"))
    ours, whole = opened(changeable), opened(drive_0009)
    for topic in ("/cam01/image_rect", "/velodyne_points", "/odom"):
        assert ours.stamps_ns()[topic].tolist() == whole.stamps_ns()[topic].tolist()
    assert not ours.notes


def test_whole_list_of_times_goes_by_the_numbers(opened, changeable, drive_0009):
    """Of a part whose list of times was not cut."""
    for path in changeable.glob("*/data/*"):
        if int(path.stem) < 3:
            path.unlink()
    ours, whole = opened(changeable), opened(drive_0009)
    for topic in ("/cam01/image_rect", "/velodyne_points", "/odom"):
        assert ours.stamps_ns()[topic].tolist() == whole.stamps_ns()[topic][3:].tolist()
    assert "image_01: 3 of 5 frames are missing" in ours.loss.notes


def test_missing_frames_are_counted_and_said(opened, changeable, drive_0009):
    (changeable / "image_01/data/0000000001.png").unlink()
    recording = opened(changeable)
    expected = opened(drive_0009).stamps_ns()["/cam01/image_rect"].tolist()
    del expected[1]
    assert recording.stamps_ns()["/cam01/image_rect"].tolist() == expected
    assert recording.loss.notes == ["image_01: 1 of 5 frames are missing"]
    assert recording.loss.messages == 1


def test_frames_whose_line_is_empty_are_neither_there_nor_missing(opened, changeable):
    """As the scans that the scanner lost in drive 0009."""
    (changeable / "velodyne_points/data/0000000002.bin").unlink()
    for name in ("timestamps", "timestamps_start", "timestamps_end"):
        path = changeable / f"velodyne_points/{name}.txt"
        lines = path.read_text().splitlines()
        lines[2] = ""
        replace_file(path, "\n".join(lines).encode())
    recording = opened(changeable)
    assert len(messages(recording, "/velodyne_points")) == 4
    assert not recording.notes


def test_missing_times_are_those_of_the_same_turn(opened, drive_0052):
    recording = opened(drive_0052)
    stamps = recording.stamps_ns()
    lines = (drive_0052 / "oxts/timestamps.txt").read_text().splitlines()
    expected = [np.datetime64(line, "ns").astype(int) for line in lines]
    for topic in ("/cam00/image_rect", "/cam02/image_rect", "/velodyne_points", "/imu/data"):
        assert stamps[topic].tolist() == expected
    assert len(recording.notes) == 3
    assert all("like the frames of oxts with the same number" in note for note in recording.notes)


def test_single_missing_times_are_counted_on(opened, changeable):
    """The sensor's neighbours tell the rate, where no other sensor has that frame."""
    for folder in changeable.iterdir():
        if folder.name != "image_00":
            shutil.rmtree(folder)
    path = changeable / "image_00/timestamps.txt"
    lines = path.read_text().splitlines()
    replace_file(path, "\n".join(lines[:4]).encode())
    stamps = opened(changeable).stamps_ns()["/cam00/image_rect"]
    assert np.diff(stamps)[3] == pytest.approx(103.7 * MS, abs=2 * MS)


def test_drive_without_any_times_is_counted_from_its_day(opened, changeable):
    for path in changeable.glob("*/timestamps*.txt"):
        path.unlink()
    recording = opened(changeable)
    day_ns = int(np.datetime64("2011-09-26", "ns").astype(np.int64))
    expected = [day_ns + number * 100 * MS for number in range(5)]
    for topic in ("/cam03/image_rect", "/velodyne_points", "/odom"):
        assert recording.stamps_ns()[topic].tolist() == expected
    assert all("10 Hz from 2011-09-26 00:00:00 on" in note for note in recording.notes)


def test_without_calibration_what_it_tells_is_left_out(opened, changeable):
    for path in changeable.parent.glob("calib_*.txt"):
        path.unlink()
    recording = opened(changeable)
    assert "/cam00/image_rect" in recording.topics
    assert "/cam00/camera_info" not in recording.topics
    assert messages(recording, "/cam00/image_rect")[0].camera_info is None
    sent = messages(recording, "/tf_static")[0].transforms
    assert {one.child_frame_id for one in sent} == {"odom", "imu_link"}
    assert len(recording.notes) == 3


def test_turns_without_a_file_of_their_times_are_a_remark(opened, changeable):
    (changeable / "velodyne_points/timestamps_end.txt").unlink()
    recording = opened(changeable)
    assert "/velodyne_points/scan_end" not in recording.topics
    said = "velodyne_points: no timestamps_end.txt, so /velodyne_points/scan_end is missing"
    assert recording.notes == [said]
    assert not recording.loss


def test_scans_of_unsynced_drives_are_texts(opened, changeable):
    bins = sorted((changeable / "velodyne_points/data").iterdir())
    expected = np.fromfile(bins[0], "<f4").reshape(-1, 4)[:1000]
    for path in bins:
        path.unlink()
        np.savetxt(path.with_suffix(".txt"), expected, "%.9g")
    cloud = messages(opened(changeable), "/velodyne_points")[0]
    assert np.array_equal(cloud.xyz, expected[:, :3])


def test_unsynced_drive_is_told_by_its_images_where_its_name_says_nothing(opened, changeable):
    drive = changeable.rename(changeable.with_name("mine"))
    assert "/cam00/image_rect" in opened(drive).topics
    cv2 = pytest.importorskip("cv2")
    for path in drive.glob("image_0*/data/*.png"):
        path.unlink()
        cv2.imwrite(str(path), np.zeros((512, 1392), np.uint8))
    recording = opened(drive)
    assert "/cam00/image_raw" in recording.topics
    assert fixed_transform(recording, "velodyne", "cam00_optical").shape == (4, 4)


@pytest.mark.parametrize("part", ["image_02", "image_02/data", "oxts/data"])
def test_of_a_part_the_whole_is_named(changeable, part):
    with pytest.raises(OpenError, match="a part of a KITTI drive") as error:
        open_recording(changeable / part)
    assert str(error.value).endswith(f"give the whole: {changeable}")


def test_a_camera_without_images_is_said(opened, changeable):
    for path in (changeable / "image_02/data").iterdir():
        path.unlink()
    (changeable / "image_02/timestamps.txt").unlink()
    shutil.rmtree(changeable / "image_03/data")
    shutil.rmtree(changeable / "image_01")
    recording = opened(changeable)
    assert recording.notes == ["image_02: holds no frames; unpack it again if it should have some"]
    assert recording.loss.notes == ["image_03: 5 of 5 frames are missing"]
    assert recording.loss.messages == 5
    assert {topic[:6] for topic in recording.topics if topic.startswith("/cam")} == {"/cam00"}
