"""Pictures in files, and what is said of those that are damaged."""

import zlib

import cv2
import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.sources import info
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.pictures import read_picture

PIXELS = np.random.default_rng(1).integers(0, 255, (20, 30, 3), np.uint8)
HEAD = 33  # bytes of a PNG until after its header


@pytest.fixture
def png():
    return cv2.imencode(".png", PIXELS)[1].tobytes()


def part(kind, content):
    return (
        len(content).to_bytes(4, "big")
        + kind
        + content
        + zlib.crc32(kind + content).to_bytes(4, "big")
    )


@pytest.mark.parametrize("cut", [lambda f: f[:300], lambda f: f[:200] + b"\0\0\0" + f[203:]])
def test_a_damaged_png_is_none_and_nobody_else_tells_so(png, tmp_path, capfd, cut):
    path = tmp_path / "damaged.png"
    path.write_bytes(cut(png))
    with pytest.raises(OpenError, match="not a readable image"):
        read_picture(path)
    assert capfd.readouterr().err == ""


def test_what_a_png_says_beside_its_pixels_does_not_matter(png, tmp_path, capfd):
    path = tmp_path / "noted.png"
    profile = b"ICC profile\0\0" + zlib.compress(b"no profile")
    path.write_bytes(png[:HEAD] + part(b"iCCP", profile) + png[HEAD:])
    assert (read_picture(path).pixels == PIXELS).all()
    assert capfd.readouterr().err == ""


def test_a_folder_of_pictures_is_summarized_and_its_videos_are_named(tmp_path, png, caplog):
    for number in range(3):
        (tmp_path / f"{number}.png").write_bytes(png)
    found = info(str(tmp_path))
    assert (found["format"], found["messages"]) == ("pictures", 3)
    assert not caplog.text
    (tmp_path / "clip.MP4").touch()
    assert info(str(tmp_path))["messages"] == 3
    assert f"not videos; to play one: {tmp_path / 'clip.MP4'}" in caplog.text
    (tmp_path / "clip.MP4").unlink()
    with pytest.raises(OpenError, match="to play it: ros-visualise video"):
        open_recording(tmp_path)


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large.png"
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        file.truncate(1 << 40)
    with pytest.raises(OpenError, match=r"large\.png: a file of 1024\.0 GiB; limit: 128 MiB"):
        read_picture(path)
