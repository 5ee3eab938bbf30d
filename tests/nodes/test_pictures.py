"""Pictures as images: a file, or a folder of them."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from ros_visualise.core.errors import OpenError
from ros_visualise.nodes.pictures import PicturesNode, PicturesParams
from ros_visualise.sources.playback import Playback

S = 10**9


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Gray pictures of the levels 9 and 10, a text, and a folder."""
    for level in (10, 9):
        cv2.imwrite(str(tmp_path / f"{level}.png"), np.full((24, 32), level, np.uint8))
    (tmp_path / "notes.txt").write_text("none")
    (tmp_path / "more.png").mkdir()
    return tmp_path


def play(path: Path, **params: object) -> list[tuple[int, np.ndarray]]:
    node = PicturesNode(PicturesParams(path=str(path), **params), Playback(rate=0))
    return [(one.header.stamp_ns, one.pixels) for _, one in node.messages()]


def test_they_come_in_the_order_of_their_numbers_at_a_rate(folder: Path) -> None:
    found = play(folder, fps=4)
    assert [(stamp, pixels[0, 0]) for stamp, pixels in found] == [(0, 9), (S // 4, 10)]


def test_one_can_begin_in_the_middle(folder: Path) -> None:
    node = PicturesNode(PicturesParams(path=str(folder)), Playback(rate=0, start_s=1))
    assert [one.pixels[0, 0] for _, one in node.messages()] == [10]


def test_colours_and_depth_are_those_of_the_file(tmp_path: Path) -> None:
    pixels = np.arange(24, dtype=np.uint16).reshape(2, 4, 3) * 1000
    cv2.imwrite(str(tmp_path / "deep.png"), pixels)
    node = PicturesNode(PicturesParams(path=str(tmp_path / "deep.png")), Playback(rate=0))
    [(_, image)] = node.messages()
    assert image.encoding == "bgr16"
    np.testing.assert_array_equal(image.pixels, pixels)


def test_each_gets_the_calibration(folder: Path, calibration: str) -> None:
    node = PicturesNode(PicturesParams(str(folder), camera_info_url=calibration), Playback(rate=0))
    assert [image.camera_info.K[0, 0] for _, image in node.messages()] == [20, 20]


def test_what_is_no_picture_is_said_and_left_out_of_a_folder(folder: Path) -> None:
    (folder / "11.jpg").write_bytes(b"no picture")
    whole = cv2.imencode(".jpg", np.zeros((64, 64), np.uint8))[1].tobytes()
    (folder / "12.jpg").write_bytes(whole[:-200])  # its end is missing
    node = PicturesNode(PicturesParams(path=str(folder)), Playback(rate=0))
    assert len(list(node.messages())) == 2
    notes = node.report()["lost"]["notes"]
    assert [
        "11.jpg: not a readable image" in note or "12.jpg: not a readable image" in note
        for note in notes
    ] == [
        True,
        True,
    ]


def test_what_cannot_be_opened_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_bytes(b"none")
    (tmp_path / "empty").mkdir()
    for path, message in {
        "": "give a picture",
        str(tmp_path / "none.png"): "no such file",
        str(tmp_path / "bad.png"): "not a readable image",
        str(tmp_path / "empty"): "a folder without pictures",
    }.items():
        with pytest.raises(OpenError, match=message):
            PicturesNode(PicturesParams(path=path), Playback())
