"""Boards: found in pictures of known truth, whichever way their counts are told, and printed."""

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_pictures import Studio, poses_of

import ros_visualise
from ros_visualise.commands import main
from ros_visualise.core.errors import UsageError
from ros_visualise.landmarks.calibration import finder as finder_module
from ros_visualise.landmarks.calibration.boards import (
    BoardKind,
    board_of,
    dictionary_of,
    marker_corners,
    points_xy,
)
from ros_visualise.landmarks.calibration.calibrating import calibrate
from ros_visualise.landmarks.calibration.finder import BoardFinder
from ros_visualise.landmarks.calibration.finding import find_board
from ros_visualise.landmarks.calibration.lenses import MODELS, Lens, project
from ros_visualise.landmarks.calibration.sheet import (
    lay_out,
    lay_out_tag,
    rasterise,
    to_pdf,
    to_svg,
)
from ros_visualise.landmarks.calibration.views import BoardView
from ros_visualise.landmarks.tags import family

SIZE = (480, 360)
CAMERA = np.array([390, 391, 241, 178, -0.2, 0.06, 0.001, -0.0005, 0])
MODEL = MODELS[Lens.PINHOLE]
CHESSBOARD = board_of(BoardKind.CHESSBOARD, "7x5")
CHARUCO = board_of(BoardKind.CHARUCO, "7x6")
APRILGRID = board_of(BoardKind.APRILGRID, "5x4")


@pytest.fixture(scope="module")
def pictures():
    """Board -> pictures of it and its poses."""
    made = {}

    def take(board, count):
        have = made.setdefault(board, [])
        if len(have) < count:
            random = np.random.default_rng(7)
            studio = Studio(board, CAMERA, MODEL, SIZE)
            poses = poses_of(board, 9, random, 1.1, spread=0.12)
            have += [(studio.take(pose, random), pose) for pose in poses[len(have) : count]]
        return have[:count]

    return take


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO, APRILGRID], ids=lambda one: one.kind.value)
def test_points_are_found_to_a_fraction_of_a_pixel(pictures, board):
    for picture, pose in pictures(board, 3):
        found = find_board(picture, board)
        assert len(found.numbers) > 0.6 * len(points_xy(board))
        xyz = np.column_stack([points_xy(board), np.zeros(len(points_xy(board)))])
        true = project(xyz, pose, CAMERA, MODEL)[0][found.numbers]
        if board is CHESSBOARD and np.abs(true - found.uv).max() > 5:
            true = true[::-1]  # it looks the same turned by half a turn
        errors = np.linalg.norm(true - found.uv, axis=1)
        assert np.median(errors) < 0.08
        assert errors.max() < 1


def test_the_camera_lies_within_its_own_deviations(pictures):
    """By pictures, not by points: the mean of 9 squared errors, each of variance 1."""
    seen = [find_board(picture, APRILGRID) for picture, _ in pictures(APRILGRID, 9)]
    views = [BoardView("", APRILGRID, points, SIZE) for points in seen if points is not None]
    assert len(views) >= 7
    found = calibrate(views, Lens.PINHOLE)
    error = found.fit.numbers - CAMERA
    assert abs(error[0]) < 1
    assert error @ np.linalg.solve(found.fit.covariance, error) < 27.9  # 99.9% of chi-square


@pytest.mark.parametrize(
    ("board", "said"),
    [
        (CHESSBOARD, "8x6"),  # squares
        (CHESSBOARD, "6x4"),  # would be found in it
        (CHARUCO, "6x7"),
        (CHARUCO, "6x5"),  # inner corners
        (replace(CHARUCO, white_first=True), "7x6"),
        (APRILGRID, "4x5"),
        (replace(APRILGRID, border=1, upwards=False), "5x4"),
    ],
)
def test_other_readings_of_the_counts_are_tried(pictures, board, said):
    finder = BoardFinder(board_of(board.kind, said))
    for picture, _ in pictures(board, 2):
        assert finder.look(picture, "") is not None
    assert finder.board == board


@pytest.mark.parametrize(
    ("board", "said"),
    [
        (board_of(BoardKind.CHARUCO, "7x6", dictionary="4X4_50"), "7x6"),
        (board_of(BoardKind.CHARUCO, "7x6", dictionary="APRILTAG_36h11"), "6x7"),
        (board_of(BoardKind.CHARUCO, "7x6", dictionary="6X6_50"), "6x5"),
        (board_of(BoardKind.APRILGRID, "5x4", dictionary="APRILTAG_25h9"), "5x4"),
    ],
    ids=lambda one: getattr(one, "dictionary", one),
)
def test_other_dictionaries_are_tried_and_the_right_one_is_named(pictures, board, said):
    finder = BoardFinder(board_of(board.kind, said))
    for picture, _ in pictures(board, 2):
        assert finder.look(picture, "") is not None
    assert finder.board == board
    assert board.dictionary in finder.board.words


def test_images_without_a_board_do_not_try_dictionaries_for_ever(pictures, monkeypatch):
    """In the first, second, fourth image: of 40, in 6."""
    tried = []
    found = finder_module.find_markers
    count = lambda gray, board: (tried.append(board.dictionary), found(gray, board))[1]  # noqa: E731
    monkeypatch.setattr(finder_module, "find_markers", count)
    finder = BoardFinder(CHARUCO)
    for _ in range(40):
        assert finder.look(np.full((100, 100), 128, np.uint8), "") is None
    assert tried.count("4X4_50") == 6
    picture = pictures(CHARUCO, 1)[0][0]
    assert finder.look(picture, "").board == CHARUCO


@pytest.mark.parametrize("bits", [4, 5, 6, 7])
def test_larger_dictionaries_begin_with_the_smaller_ones(bits):
    boards = [
        board_of(BoardKind.CHARUCO, "7x6", dictionary=f"{bits}X{bits}_{size}")
        for size in (50, 100, 250, 1000)
    ]
    codes = [dictionary_of(board).bytesList for board in boards]
    for larger in codes[1:]:
        assert np.array_equal(larger[:50], codes[0])


@pytest.mark.parametrize("board", [CHESSBOARD, CHARUCO, APRILGRID], ids=lambda one: one.kind.value)
def test_what_is_not_there_is_not_found(pictures, board):
    other = CHARUCO if board is APRILGRID else APRILGRID
    assert find_board(pictures(other, 1)[0][0], board) is None
    assert find_board(np.full((100, 100), 128, np.uint8), board) is None


def test_kalibr_counts_tags_from_the_lower_left():
    corners = marker_corners(APRILGRID)
    assert corners[0, 0, 0] < corners[1, 0, 0]
    assert corners[0, 0, 1] > corners[5, 0, 1]  # y down
    assert corners[1, 0, 0] - corners[0, 0, 0] == pytest.approx(1.3 * APRILGRID.square)


def rasterised(svg: bytes, per_mm: float) -> np.ndarray:
    """The rectangles of an SVG file, drawn anew."""
    text = svg.decode()
    width, height = map(float, re.search(r'width="([\d.]+)mm" height="([\d.]+)mm"', text).groups())
    page = np.full((round(height * per_mm), round(width * per_mm)), 255, np.uint8)
    for found in re.findall(r"M([\d.]+) ([\d.]+)h([\d.]+)v([\d.]+)h-[\d.]+z", text):
        x, y, w, h = map(float, found)
        corners = np.rint(np.array([x, y, x + w, y + h]) * per_mm).astype(int)
        page[corners[1] : corners[3], corners[0] : corners[2]] = 0
    return page


@pytest.mark.parametrize("kind", [*BoardKind], ids=lambda one: one.value)
@pytest.mark.parametrize("page", ["A4", "Letter"])
def test_what_is_printed_is_found_to_scale(kind, page):
    board, per_mm = board_of(kind, "6x5"), 5.0
    sheet = lay_out(board, page, None)
    true = points_xy(replace(board, square=sheet.side)) + np.array([sheet.left, sheet.top])
    for drawn in (rasterised(to_svg(sheet), per_mm), rasterise(sheet, per_mm * 25.4)):
        found = find_board(cv2.GaussianBlur(drawn, (0, 0), 1), board)
        seen = (found.uv + 0.5) / per_mm
        assert len(seen) == len(true)
        there = true if np.abs(seen - true[found.numbers]).max() < 5 else true[::-1]
        assert np.abs(seen - there[found.numbers]).max() < 0.15


def test_a_pdf_is_as_large_as_the_page():
    box = re.search(rb"MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", to_pdf(lay_out(CHARUCO, "A4", 0.02)))
    assert [float(one) / 72 * 25.4 for one in box.groups()] == pytest.approx([297, 210], abs=0.05)


@pytest.mark.parametrize("name", ["tag36h11", "tagStandard41h12", "5x5_1000"])
def test_a_printed_tag_has_its_id_and_its_size(name):
    sheet, per_mm = lay_out_tag(family(name), 7, "A4", 0.09), 5.0
    for drawn in (rasterised(to_svg(sheet), per_mm), rasterise(sheet, per_mm * 25.4)):
        [tag] = ros_visualise.detect(drawn, name)
        sides = (
            np.linalg.norm(np.diff(tag.corners_uv, axis=0, append=tag.corners_uv[:1]), axis=1)
            / per_mm
        )
        assert tag.id.endswith("7")
        assert sides == pytest.approx(90, abs=0.1)


def test_a_pdf_of_tags_has_a_page_for_each(tmp_path, capsys):
    for ids, pages in (("0-2,9", 4), ("5", 1)):
        file = tmp_path / f"{pages}.pdf"
        assert main(["tags", str(file), "--ids", ids, "--size", "0.05", "--page", "100x110"]) == 0
        assert file.read_bytes().count(b"/MediaBox") == pages
    for wrong in ("3-1", "x", "0-999", "600"):
        assert main(["tags", str(tmp_path / "no.pdf"), "--ids", wrong, "--page", "100x110"]) == 2
    assert "choose from 0 to 586" in capsys.readouterr().err


def test_a_board_that_does_not_fit_is_refused_with_what_does():
    with pytest.raises(UsageError, match=r"--square 0\.028"):
        lay_out(CHESSBOARD, "A4", 0.1)


def test_boards_are_found_with_the_systems_opencv_too(pictures, tmp_path, run_on_system_opencv):
    """Debian 12 has 4.6, whose calls for markers are others."""
    boards = (CHESSBOARD, CHARUCO, APRILGRID)
    for board in boards:
        cv2.imwrite(str(tmp_path / f"{board.kind.value}.png"), pictures(board, 1)[0][0])
    code = (
        "import sys, cv2\n"
        "from ros_visualise.landmarks.calibration.boards import BoardKind, board_of\n"
        "from ros_visualise.landmarks.calibration.finding import find_board\n"
        "for kind, counts in zip(BoardKind, sys.argv[2:]):\n"
        "    gray = cv2.imread(f'{sys.argv[1]}/{kind.value}.png', 0)\n"
        "    found = find_board(gray, board_of(kind, counts))\n"
        "    print(len(found.numbers), *found.uv.mean(axis=0))\n"
    )
    counts = [f"{board.columns}x{board.rows}" for board in boards]
    said = run_on_system_opencv(code, str(tmp_path), *counts)
    for board, line in zip(boards, said.splitlines(), strict=True):
        number, *middle = map(float, line.split())
        here = find_board(pictures(board, 1)[0][0], board)
        assert number == pytest.approx(len(here.numbers), rel=0.15)
        if number == len(here.numbers):
            assert middle == pytest.approx(here.uv.mean(axis=0), abs=0.1)


def test_a_fisheye_is_calibrated_by_a_board_of_tags():
    """Most tags of it are not recognized where they touch, and are found beside others."""
    lens, true = MODELS[Lens.FISHEYE], np.array([170, 171, 238, 181, 0.03, -0.01, 0.004, -0.001])
    random = np.random.default_rng(0)
    studio = Studio(APRILGRID, true, lens, SIZE)
    seen = [
        find_board(studio.take(pose, random), APRILGRID)
        for pose in poses_of(APRILGRID, 9, random, 0.7, spread=0.6)
    ]
    views = [BoardView("", APRILGRID, points, SIZE) for points in seen if points is not None]
    found = calibrate(views, Lens.FISHEYE)
    error = found.fit.numbers - true
    assert abs(error[:2]).max() < 0.4
    assert error @ np.linalg.solve(found.fit.covariance, error) < 26.1  # 99.9% of chi-square
