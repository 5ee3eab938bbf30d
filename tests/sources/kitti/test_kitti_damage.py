"""Files that are cut off, changed or empty: left out, counted, and said."""

import pytest
from kitti_reading import messages, replace_file

NAME = "0000000002"


@pytest.mark.parametrize(
    "spoil",
    [
        lambda data: data[: len(data) // 2],
        lambda data: data[:-1],
        lambda data: data[:100_000] + bytes([data[100_000] ^ 1]) + data[100_001:],
        lambda data: data[:20],
        lambda data: b"JPEG" + data,
        lambda data: data[:8],
        lambda data: b"",
    ],
)
def test_broken_images_are_left_out(opened, changeable, spoil):
    path = changeable / f"image_02/data/{NAME}.png"
    data = spoil(path.read_bytes())
    replace_file(path, data)
    recording = opened(changeable)
    for _ in range(2):  # counted once, however often it is read
        found = messages(recording, "/cam02/image_rect")
        assert len(found) == 4
        assert all(image.pixels.shape == (375, 1242, 3) for image in found)
        assert (recording.loss.messages, recording.loss.bytes) == (1, len(data))
    assert recording.loss.notes[0].startswith(f"image_02/data/{NAME}.png: ")


@pytest.mark.parametrize("spoil", [lambda data: data[:-5], lambda data: b""])
def test_cut_scans_are_left_out(opened, changeable, spoil):
    path = changeable / f"velodyne_points/data/{NAME}.bin"
    replace_file(path, spoil(path.read_bytes()))
    recording = opened(changeable)
    assert len(messages(recording, "/velodyne_points")) == 4
    assert recording.loss.messages == 1


def test_scans_of_words_are_left_out(opened, changeable):
    for path in sorted((changeable / "velodyne_points/data").iterdir()):
        path.unlink()
        path.with_suffix(".txt").write_text("1 2 3 0.5\n")
    path.with_suffix(".txt").write_text("no scan at all")
    recording = opened(changeable)
    assert len(messages(recording, "/velodyne_points")) == 4
    assert recording.loss.messages == 1


@pytest.mark.parametrize("text", ["", "1 2 3", "nan " * 30, "91 " * 30, "word " * 30, "\xff\xfe"])
def test_spoilt_samples_are_left_out(opened, changeable, text):
    replace_file(changeable / f"oxts/data/{NAME}.txt", text.encode("latin-1"))
    recording = opened(changeable)
    for topic in ("/imu/data", "/gps/fix", "/gps/vel", "/odom", "/tf"):
        assert recording.topics[topic].messages == len(messages(recording, topic)) == 4
    assert recording.loss.messages == 5
    assert len(recording.loss.notes) == 1


def test_many_damaged_files_are_one_line(opened, changeable):
    for path in changeable.glob("image_02/data/*"):
        replace_file(path, b"broken")
    recording = opened(changeable)
    assert messages(recording, "/cam02/image_rect") == []
    (note,) = recording.loss.notes
    assert note.endswith("not a PNG image; 5 such files skipped")


def test_damaged_lines_of_times_are_filled(opened, changeable, drive_0009):
    path = changeable / "image_00/timestamps.txt"
    lines = path.read_text().splitlines()
    lines[1], lines[3] = "2011-13-26 13:08:25.077800192", "0x12"
    replace_file(path, "\n".join(lines).encode())
    recording = opened(changeable)
    stamps = recording.stamps_ns()
    assert stamps["/cam00/image_rect"][1] == stamps["/velodyne_points"][1]
    (note,) = recording.loss.notes
    assert note.startswith("image_00/timestamps.txt: 2 of 5 times are missing or damaged; frames")
    assert not recording.notes
