"""What a path is, is found out by looking at it."""

import bz2
import gzip
import lzma
from contextlib import closing

import made_bags
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.sources import open_source
from ros_visualise.sources.opening import is_recording, open_again, open_recording

START = {
    "mcap": b"\x89MCAP0\r\n",
    "ulog": b"ULog\x01\x12\x35\x01",
    "sqlite": b"SQLite format 3\0",
    "srt": b"\xef\xbb\xbf1\r\n00:00:00,000 --> 00:00:01,000\r\nHOME(1,2)\r\n",
}
OTHER = {
    "video": b"\0\0\0\x20ftypisom" + bytes(100),
    "text": b"1 2 3 --> 4\n",
    "empty": b"",
}


@pytest.mark.parametrize("name", ["a.bag", "a.bag.active", "a.mp4", "ümlaut mit Lücke", "a.orig.1"])
def test_a_bag_is_one_whatever_its_name(tmp_path, name):
    path = tmp_path / name
    written = made_bags.drive(path, steps=2)
    assert is_recording(path)
    assert made_bags.contents(open_recording(str(path))) == written


@pytest.mark.parametrize("kind", START)
def test_it_goes_by_the_content(tmp_path, kind):
    path = tmp_path / "file.bag"
    path.write_bytes(START[kind])
    assert is_recording(path)


@pytest.mark.parametrize("kind", OTHER)
def test_what_is_none_is_refused(tmp_path, kind):
    path = tmp_path / "file.bag"
    path.write_bytes(OTHER[kind])
    assert not is_recording(path)
    assert_refused(path, "record it again" if kind == "empty" else f"ros-visualise video {path}")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("log.ulg", "not a valid PX4 flight log"),
        ("DJI.SRT", "not a valid DJI subtitle file"),
        ("r.db3", "not a valid ROS 2 bag's SQLite file"),
        ("r.mcap", "not a valid MCAP file"),
        ("r.bag", "not a valid ROS 1 bag"),
    ],
)
@pytest.mark.parametrize("open_it", [open_recording, open_source])
def test_what_is_not_what_its_name_says_is_reported(tmp_path, name, says, open_it):
    path = tmp_path / name
    path.write_bytes(b"ULoG\x01\x12\x35\x01" + bytes(100))
    with pytest.raises(OpenError) as refused:
        open_it(path)
    assert str(refused.value).startswith(f"{path}: {says}")


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_what_is_packed_is_to_be_unpacked(tmp_path, pack):
    path = tmp_path / "drive.bag.packed"
    path.write_bytes(pack(b"#ROSBAG V2.0\n" + bytes(1000)))
    assert_refused(path, "unpack it")


def test_a_trajectory_names_its_command(tmp_path):
    path = tmp_path / "truth.txt"
    path.write_text("# stamp x y z qx qy qz qw\n1.5 1 2 3 0 0 0 1\n")
    assert_refused(path, f"ros-visualise trajectory {path}")


def test_nothing_is_refused(tmp_path):
    assert not is_recording(tmp_path / "missing")
    assert_refused(tmp_path / "missing", "no such file")
    assert_refused("/dev/null", "not a regular file")


def test_a_folder_with_one_recording_opens_it_and_with_several_asks(tmp_path):
    assert_refused(tmp_path, "no recording, video or picture in this folder")
    (tmp_path / "clip.mp4").write_bytes(OTHER["video"])
    assert_refused(tmp_path, f"contains clip.mp4; choose one, for instance {tmp_path / 'clip.mp4'}")
    written = made_bags.drive(tmp_path / "only.bag", steps=1)
    assert made_bags.contents(open_recording(tmp_path)) == written
    (tmp_path / "only.bag").unlink()
    for name in "bcdea":
        made_bags.drive(tmp_path / f"{name}.bag", steps=1)
    said = assert_refused(tmp_path, "a.bag, b.bag, c.bag and 2 more")
    assert said.endswith(str(tmp_path / "a.bag"))


def test_a_folder_above_pictures_or_videos_names_theirs(tmp_path):
    for name in (".trash", "image_l", "image_r"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "000000.png").write_bytes(b"")
    assert_refused(
        tmp_path, f"contains image_l, image_r; choose one, for instance {tmp_path / 'image_l'}"
    )


def test_notes_are_logged_once_though_a_recording_is_opened_again(recordings, caplog):
    path = recordings / "trajectory/dji_srt/mavic_mini.SRT"
    with closing(open_recording(path)) as first, closing(open_again(first)) as again:
        assert again.notes == first.notes
    assert [one.getMessage() for one in caplog.records] == [f"{path}: {first.notes[0]}"]


def assert_refused(path, says):
    with pytest.raises(OpenError) as error:
        open_recording(path)
    said = str(error.value)
    assert said.startswith(f"{path}: ")
    assert says in said
    assert "\n" not in said
    return said
