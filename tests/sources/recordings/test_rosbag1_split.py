"""ROS 1 bags that were split while they were recorded, and played as one."""

import json

import pytest
from made_bags import PERIOD_NS, START_NS, BagWriter, T, contents, drive

from ros_visualise.commands import main
from ros_visualise.sources.opening import open_recording

STRING = "std_msgs/msg/String"
UNTIL_NOW = ["run_0.bag", "run_1.bag", "run_2.bag"]
DATED = [f"run_2024-01-0{day}-12-00-00_{day - 1}.bag" for day in (1, 2, 3)]


def split(folder, names, each=5):
    """Parts of a recording whose messages overlap a little; what was written, in order of time."""
    written = []
    for number, name in enumerate(names):
        with BagWriter(folder / name, chunk_size=200) as bag:
            bag.connect("a", "/a", STRING, callerid="/talker")
            bag.connect("b", f"/only_{number}", STRING, callerid="/talker")
            for step in range(each):
                stamp_ns = START_NS + (number * (each - 1) + step) * PERIOD_NS
                bag.write("ab"[step % 2], stamp_ns, T[STRING](f"{number} {step}"))
        written += bag.messages
    return sorted(written, key=lambda message: message.stamp_ns)


@pytest.mark.parametrize("names", [UNTIL_NOW, DATED, ["_9.bag", "_10.bag", "_11.bag"]])
def test_the_parts_are_one_recording(tmp_path, names):
    written = split(tmp_path, names)
    recording = open_recording(tmp_path)
    assert contents(recording) == written
    assert not recording.loss
    assert sorted(recording.topics) == ["/a", "/only_0", "/only_1", "/only_2"]
    assert recording.topics["/a"].type.callerids == ("/talker",)
    assert recording.size == sum(file.stat().st_size for file in tmp_path.iterdir())


def test_one_part_alone_is_that_part(tmp_path):
    written = split(tmp_path, UNTIL_NOW)
    recording = open_recording(tmp_path / "run_1.bag")
    assert contents(recording) == [m for m in written if m.data[4:].startswith(b"1")]
    assert not recording.loss


@pytest.mark.parametrize("names", [UNTIL_NOW, DATED])
def test_a_part_that_lacks_between_others_is_said(tmp_path, names):
    split(tmp_path, names)
    (tmp_path / names[1]).unlink()
    assert open_recording(tmp_path).loss.notes == ["its part 1 is missing"]


def test_the_first_ones_may_have_been_deleted_by_the_recorder(tmp_path):
    split(tmp_path, UNTIL_NOW)
    (tmp_path / "run_0.bag").unlink()
    assert not open_recording(tmp_path).loss


def test_a_part_that_cannot_be_read_costs_that_part(tmp_path):
    written = split(tmp_path, UNTIL_NOW)
    (tmp_path / "run_2.bag").write_bytes(b"#ROSBAG V2.0\nnothing")
    recording = open_recording(tmp_path)
    assert contents(recording) == [m for m in written if not m.data[4:].startswith(b"2")]
    assert all(note.startswith("run_2.bag: ") for note in recording.loss.notes)
    assert recording.loss


def test_a_link_to_nothing_costs_that_part(tmp_path):
    written = split(tmp_path, UNTIL_NOW)
    (tmp_path / "run_1.bag").unlink()
    (tmp_path / "run_1.bag").symlink_to(tmp_path / "gone.bag")
    recording = open_recording(tmp_path)
    assert contents(recording) == [m for m in written if not m.data[4:].startswith(b"1")]
    (note,) = recording.loss.notes
    assert note == "run_1.bag: No such file or directory; check the path"


def test_bags_of_several_recordings_are_to_be_chosen_from(tmp_path, capsys):
    drive(tmp_path / "2024-01-01-12-00-00.bag", steps=1)
    drive(tmp_path / "2024-01-02-12-00-00.bag", steps=1)
    assert main(["info", str(tmp_path)]) == 2
    assert "choose" in capsys.readouterr().err


def test_the_folder_is_described_and_converted(tmp_path, capsys):
    folder = tmp_path / "run"
    folder.mkdir()
    written = split(folder, UNTIL_NOW)
    assert main(["info", "--json", str(folder)]) == 0
    about = json.loads(capsys.readouterr().out)
    assert (about["messages"], about["format"]) == (len(written), "rosbag 2.0")
    assert main(["convert", str(folder), str(tmp_path / "out.bag")]) == 0
    assert contents(open_recording(tmp_path / "out.bag")) == written
