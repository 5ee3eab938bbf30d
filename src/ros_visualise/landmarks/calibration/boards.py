"""Calibration boards: where their points are, and which parts are black.

A board's frame has its origin at the top left corner of the pattern, x right, y down, as seen from
the front; all lengths are in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Floats

Ints = npt.NDArray[np.int64]


class BoardKind(Enum):
    """Kinds of boards."""

    CHESSBOARD = "chessboard"
    CHARUCO = "charuco"
    APRILGRID = "aprilgrid"


@dataclass(frozen=True)
class Board:
    """One interpretation of the description of a board.

    ``columns`` and ``rows`` count the inner corners of a chessboard, the squares of a ChArUco
    board, the tags of an AprilGrid. ``square`` is the side of a square or tag. ``share`` is the
    side of a ChArUco marker, or the spacing of an AprilGrid, as a fraction of it. ``dictionary`` is
    OpenCV's, such as ``5X5_1000``. ``white_first``: the top left square of a ChArUco board is
    white, as OpenCV drew those with an even number of rows before 4.7. ``border``: black cells
    around a tag's code: Kalibr has 2, others 1. ``upwards``: tags are counted from the lowest row,
    as in Kalibr.
    """

    kind: BoardKind
    columns: int
    rows: int
    square: float = 0.025
    share: float = 0.0
    dictionary: str = ""
    white_first: bool = False
    border: int = 1
    upwards: bool = False

    @property
    def counts(self) -> str:
        """Size in words, such as ``9x6 inner corners``."""
        nouns = {
            BoardKind.CHESSBOARD: "inner corners",
            BoardKind.CHARUCO: "squares",
            BoardKind.APRILGRID: "tags",
        }
        return f"{self.columns}x{self.rows} {nouns[self.kind]}"

    @property
    def noun(self) -> str:
        """Kind in words, such as ``chessboard``."""
        nouns = {BoardKind.CHARUCO: "ChArUco board", BoardKind.APRILGRID: "AprilGrid"}
        return nouns.get(self.kind, "chessboard")

    @property
    def words(self) -> str:
        """Description, such as ``chessboard of 9x6 inner corners``."""
        words = f"{self.noun} of {self.counts}"
        if self.kind is BoardKind.CHESSBOARD:
            return words
        if self.kind is BoardKind.CHARUCO:
            first = ", the first white," if self.white_first else ""
            return f"{words}{first} with markers of {self.dictionary}"
        rims = "two cells" if self.border == 2 else "one cell"
        end = "bottom" if self.upwards else "top"
        words = f"{words} of {self.dictionary}, numbered from the {end}"
        return f"{words}, with black borders of {rims}"


_SHARES = {BoardKind.CHESSBOARD: 0.0, BoardKind.CHARUCO: 0.75, BoardKind.APRILGRID: 0.3}
_DICTIONARIES = {
    BoardKind.CHESSBOARD: "",
    BoardKind.CHARUCO: "5X5_1000",
    BoardKind.APRILGRID: "APRILTAG_36h11",
}
_APRILTAGS = tuple(f"APRILTAG_{name}" for name in ("16h5", "25h9", "36h10", "36h11"))
_MOST = 100


def board_of(
    kind: BoardKind,
    counts: str,
    square: float | None = None,
    share: float | None = None,
    dictionary: str | None = None,
) -> Board:
    """A board from its description by the user.

    Args:
        kind: of board.
        counts: ``COLUMNSxROWS``, counted as in `Board`.
        square: side of a square or tag, metres; it has no effect on the camera.
        share: as in `Board`; None: 0.75 for ChArUco, 0.3 for an AprilGrid, as in Kalibr.
        dictionary: OpenCV's name; None: 5X5_1000 for ChArUco, APRILTAG_36h11 for an AprilGrid.

    Raises:
        UsageError: the description is invalid.
    """
    columns, _, rows = counts.lower().partition("x")
    sides = [int(text) if text.isdecimal() and len(text) < 4 else 0 for text in (columns, rows)]
    if not 2 <= min(sides) <= max(sides) <= _MOST:
        raise UsageError(f"size {counts!r}: give COLUMNSxROWS, such as 9x6, 2 to {_MOST} each")
    if dictionary and not has_dictionary(dictionary):
        raise UsageError(f"no such dictionary in OpenCV: {dictionary!r}; try 4X4_50 or 5X5_1000")
    found = _SHARES[kind] if share is None else share
    if kind is not BoardKind.CHESSBOARD and not 0.05 <= found <= 0.95:
        raise UsageError(
            f"share={found:g}: must be between 0.05 and 0.95 (marker size or gap divided by the"
            " side of the square or tag)"
        )
    words = dictionary or _DICTIONARIES[kind]
    board = Board(kind, sides[0], sides[1], square or 0.025, found, words)
    if kind is BoardKind.APRILGRID:
        board = replace(board, border=2, upwards=True)
    if kind is not BoardKind.CHESSBOARD and len(marker_corners(board)) > len(
        dictionary_of(board).bytesList
    ):
        raise UsageError(f"{board.dictionary} has too few markers for a board of {counts}")
    return board


def readings(board: Board) -> tuple[Board, ...]:
    """Possible interpretations of a description, the likeliest first.

    Squares may have been counted instead of inner corners or the reverse, and columns swapped with
    rows; for tags, their numbering may start elsewhere.
    """
    columns, rows = board.columns, board.rows
    if board.kind is BoardKind.CHESSBOARD:
        counts = [(columns, rows), (columns - 1, rows - 1), (columns + 1, rows + 1)]
        return tuple(replace(board, columns=c, rows=r) for c, r in counts if min(c, r) > 2)
    counts = [(columns, rows), (rows, columns)]
    if board.kind is BoardKind.CHARUCO:
        counts += [(columns + 1, rows + 1), (rows + 1, columns + 1)]
        meant = [replace(board, columns=c, rows=r) for c, r in counts]
        # OpenCV only ever started with white if the number of rows is even
        white = [replace(one, white_first=True) for one in meant if one.rows % 2 == 0]
        return tuple(dict.fromkeys([*meant[:1], *white[:1], *meant[1:], *white[1:]]))
    return tuple(
        dict.fromkeys(
            replace(board, columns=c, rows=r, border=border, upwards=upwards)
            for border in (2, 1)
            for c, r in counts
            for upwards in (True, False)
        )
    )


def outer_size(board: Board) -> tuple[float, float]:
    """Width and height of the pattern, including the outermost black squares of an AprilGrid."""
    if board.kind is BoardKind.APRILGRID:
        pitch, gap = board.square * (1 + board.share), board.square * board.share
        return board.columns * pitch + gap, board.rows * pitch + gap
    more = 1 if board.kind is BoardKind.CHESSBOARD else 0
    return (board.columns + more) * board.square, (board.rows + more) * board.square


@lru_cache(maxsize=32)
def points_xy(board: Board) -> Floats:
    """The detectable points of a board, (N, 2).

    Inner corners row by row from the top left; for an AprilGrid the corners of tag after tag,
    clockwise from the top left.
    """
    if board.kind is BoardKind.APRILGRID:
        return marker_corners(board).reshape(-1, 2)
    less = 1 if board.kind is BoardKind.CHARUCO else 0
    x, y = np.meshgrid(range(1, board.columns - less + 1), range(1, board.rows - less + 1))
    return np.stack([x.ravel(), y.ravel()], axis=1) * board.square


@lru_cache(maxsize=32)
def marker_corners(board: Board) -> Floats:
    """(M, 4, 2) corners of the markers, by id, clockwise from the top left.

    Source: OpenCV 4.6 and 4.7, CharucoBoard; Kalibr, GridCalibrationTargetAprilgrid.
    """
    if board.kind is BoardKind.APRILGRID:
        pitch, gap = board.square * (1 + board.share), board.square * board.share
        rows = reversed(range(board.rows)) if board.upwards else range(board.rows)
        origins = [(c * pitch + gap, r * pitch + gap) for r in rows for c in range(board.columns)]
        side = board.square
    else:
        side = board.square * board.share
        gap = (board.square - side) / 2
        origins = [
            (c * board.square + gap, r * board.square + gap)
            for r in range(board.rows)
            for c in range(board.columns)
            if (r + c) % 2 != board.white_first
        ]
    unit = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side
    return np.array(origins)[:, None] + unit


def dark_rectangles(board: Board) -> Floats:
    """The black parts, (N, 4): x, y, width, height; everything else is white."""
    if board.kind is BoardKind.CHESSBOARD:
        return _checks(board.columns + 1, board.rows + 1, board.square, False)
    if board.kind is BoardKind.CHARUCO:
        checks = _checks(board.columns, board.rows, board.square, board.white_first)
        return np.vstack([checks, _marker_cells(board)])
    pitch, gap = board.square * (1 + board.share), board.square * board.share
    joints = [
        (c * pitch, r * pitch, gap, gap)
        for r in range(board.rows + 1)
        for c in range(board.columns + 1)
    ]
    return np.vstack([joints, _marker_cells(board)])


def has_dictionary(name: str) -> bool:
    """True if OpenCV has a dictionary of markers of that name, without ``DICT_``."""
    return hasattr(cv2.aruco, f"DICT_{name}")


def dictionaries_of(board: Board) -> tuple[str, ...]:
    """The smallest dictionary of each kind of marker that has enough for a board.

    The larger ones of a kind begin with the same markers, so that one stands for all of them.
    """
    if board.kind is BoardKind.CHESSBOARD:
        return ()
    count = len(marker_corners(board))
    several = [*_APRILTAGS]
    if board.kind is BoardKind.CHARUCO:
        size = next((one for one in (50, 100, 250, 1000) if one >= count), 1000)
        several += [f"{bits}X{bits}_{size}" for bits in (4, 5, 6, 7)]
        several += ["ARUCO_ORIGINAL", "ARUCO_MIP_36h12"]
    boards = [replace(board, dictionary=name) for name in several if has_dictionary(name)]
    return tuple(one.dictionary for one in boards if len(dictionary_of(one).bytesList) >= count)


def dictionary_of(board: Board) -> Any:
    """OpenCV's dictionary of a board's markers."""
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}"))


def _checks(columns: int, rows: int, side: float, white_first: bool) -> Floats:
    places = [(c, r) for r in range(rows) for c in range(columns) if (r + c) % 2 == white_first]
    return np.array([(c * side, r * side, side, side) for c, r in places])


def _marker_cells(board: Board) -> Floats:
    """The black cells of all markers; horizontal neighbours are joined into one rectangle."""
    found = []
    dictionary = dictionary_of(board)
    size = dictionary.markerSize + 2 * board.border
    for number, corners in enumerate(marker_corners(board)):
        cell = float(corners[1, 0] - corners[0, 0]) / size
        for row, bits in enumerate(_draw_marker(dictionary, number, size, board.border)):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], bits == 0, [0]]).astype(int)))
            for start, stop in edges.reshape(-1, 2):
                at = corners[0] + cell * np.array([start, row])
                found.append((*at, cell * (stop - start), cell))
    return np.array(found)


def _draw_marker(dictionary: Any, number: int, size: int, border: int) -> npt.NDArray[np.uint8]:
    """One pixel per cell; 0 is black."""
    aruco: Any = cv2.aruco
    # renamed in OpenCV 4.7
    draw = getattr(aruco, "generateImageMarker", None) or aruco.drawMarker
    cells: npt.NDArray[np.uint8] = draw(dictionary, number, size, borderBits=border)
    return cells
