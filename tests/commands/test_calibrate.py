"""`ros-visualise calibrate`: real pictures, what it writes, and what it says."""

import json

import cv2
import numpy as np
import pytest
from made_videos import write_video

from ros_visualise.commands import main
from ros_visualise.landmarks.calibration.boards import BoardKind, board_of
from ros_visualise.landmarks.calibration.sheet import lay_out, rasterise
from ros_visualise.sources.calibration import read_calibration, read_uncertainty


@pytest.fixture
def run(monkeypatch, capsys):
    """Run the command; its exit status, output and what it said of errors."""
    monkeypatch.setattr("signal.signal", lambda *_: None)

    def run(*arguments):
        status = main(["calibrate", *map(str, arguments)])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def test_opencvs_pictures(recordings, run, tmp_path):
    """Published: fx = fy = 535.92; halves calibrated apart give 532 to 533."""
    out, plot = tmp_path / "left.yaml", tmp_path / "left.svg"
    pictures = sorted((recordings / "calib" / "opencv").glob("left*.jpg"))
    status, said, _ = run(*pictures, "--json", "--output", out, "--plot", plot)
    report = json.loads(said)
    assert (status, report["found"], report["outliers"]) == (0, 13, [])
    assert report["rms"] < 0.19
    assert report["halves"]["difference"] < 0.003
    assert report["K"][0] == pytest.approx(532.8, abs=1)
    assert report["deviations"]["fx"] == pytest.approx(1.2, abs=0.3)
    assert report["coverage"]["skew"] == 1
    info = read_calibration(str(out))
    assert (info.width, info.height, info.distortion_model) == (640, 480, "plumb_bob")
    assert info.K.ravel().tolist() == report["K"]
    known = read_uncertainty(str(out)).deviations
    assert known == pytest.approx([*report["deviations"].values()])
    assert plot.read_bytes().startswith(b"<svg")


def test_a_folder_told_by_its_squares(recordings, run):
    status, said, _ = run(recordings / "tags" / "swatbotics" / "calibration", "--size", "8x6")
    assert status == 0
    assert "chessboard of 7x5 inner corners (instead of 8x6 inner corners), in 17 of 17" in said
    assert "rms:                0.14" in said
    assert "next:               hold the board closer to the" in said


def test_a_board_of_another_dictionary_is_named(run, tmp_path):
    """Six pictures of a printed 4X4 board, seen from ahead."""
    board = board_of(BoardKind.CHARUCO, "7x6", dictionary="4X4_50")
    page = rasterise(lay_out(board, "A4", None), 60)
    height, width = page.shape
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    random = np.random.default_rng(3)
    for number in range(6):
        to = np.float32([[90, 60], [550, 60], [550, 420], [90, 420]])
        to += random.uniform(-50, 50, (4, 2)).astype(np.float32)
        H = cv2.getPerspectiveTransform(corners, to)
        picture = cv2.warpPerspective(page, H, (640, 480), borderValue=128, flags=cv2.INTER_AREA)
        cv2.imwrite(str(tmp_path / f"{number}.png"), picture)
    status, said, errors = run(tmp_path, "--pattern", "charuco", "--size", "7x6")
    assert status == 0, errors
    assert (
        "ChArUco board of 7x6 squares with markers of 4X4_50 (instead of 5X5_1000), in 6 of 6"
        in said
    )


def test_a_video(recordings, run, tmp_path):
    frames = [
        cv2.imread(str(path))
        for path in sorted((recordings / "calib" / "opencv").glob("left*.jpg"))[::2]
        for _ in range(2)
    ]
    write_video(tmp_path / "board.mp4", frames)
    status, said, _ = run(tmp_path / "board.mp4", "--json")
    report = json.loads(said)
    assert status == 0
    assert len(report["views"]) <= 7 <= report["images"]
    assert report["alike"] >= 5  # each picture comes twice
    assert report["K"][0] == pytest.approx(533, rel=0.02)


def test_without_a_board_it_says_what_was_tried(run, tmp_path):
    cv2.imwrite(str(tmp_path / "gray.png"), np.full((48, 64), 128, np.uint8))
    status, said, errors = run(tmp_path, "--size", "9x6")
    assert (status, said, errors.count("\n")) == (2, "", 1)
    assert "no chessboard of 9x6 inner corners, nor one of 8x5" in errors


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "nothing to do"),
        (["nix.jpg"], "no such file"),
        (["nix.jpg", "--size", "9"], "give COLUMNSxROWS"),
        (["--board", "board.doc"], "ends in .pdf or .svg"),
        (["--board", "board.pdf", "--page", "B9"], "--page B9: give A4"),
        (["--board", "b.pdf", "--pattern", "charuco", "--dictionary", "X"], "no such dictionary"),
        (["--board", "b.pdf", "--pattern", "charuco", "--dictionary", "4X4_50", "--size", "30x30"],
         "too few markers"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_is_one_line(run, arguments, words):
    status, _, errors = run(*arguments)
    assert (status, errors.count("\n")) == (2, 1)
    assert words in errors


def test_a_folder_without_pictures_is_told(run, tmp_path):
    status, _, errors = run(tmp_path)
    assert status == 2
    assert "no recording, video or picture in this folder" in errors


def test_the_board_is_written_once(run, tmp_path):
    out = tmp_path / "board.svg"
    status, _, said = run("--board", out, "--pattern", "aprilgrid", "--size", "6x6")
    assert (status, out.read_bytes()[:4]) == (0, b"<svg")
    assert "AprilGrid of 6x6 tags, 23 mm tags, 6.9 mm apart" in said
    assert run("--board", out)[0] == 2
    assert run("--board", out, "--overwrite")[0] == 0


def test_a_camera_is_followed_for_a_while(recordings, run):
    """One picture over and over: it is one view, and it says what to do next."""
    picture = recordings / "calib" / "opencv" / "left01.jpg"
    status, _, errors = run(f"lavfi:movie={picture},loop=-1:1", "--duration", "1.5")
    assert status == 2
    assert "1 view; tilt the board" in errors
    assert "too few distinct views of the board: 1" in errors


def test_what_is_broken_is_said_and_the_rest_counts(recordings, run, tmp_path):
    for path in (recordings / "calib" / "opencv").glob("left0[1-6].jpg"):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    small = cv2.resize(cv2.imread(str(tmp_path / "left01.jpg")), (480, 360))
    cv2.imwrite(str(tmp_path / "a_small.png"), small)
    (tmp_path / "broken.jpg").write_bytes((tmp_path / "left01.jpg").read_bytes()[:999])
    status, said, errors = run(tmp_path)
    assert status == 1
    assert "broken.jpg" in errors
    assert "in 7 of 7 images of 640x480" in said
    assert "1 image of another size" in said
