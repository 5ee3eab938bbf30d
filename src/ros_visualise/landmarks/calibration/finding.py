"""Finding a board's points in an image, with subpixel accuracy.

Pixels have their origin at the centre of the top-left pixel. Corners are refined by
`cv2.cornerSubPix`, with a window adapted to their distance. On real images the residuals were
smaller than with findChessboardCornersSB: 0.18 and 0.17 px against 0.25 and 0.20.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from threading import Lock
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from ros_visualise.data import Floats, Pixels
from ros_visualise.landmarks.calibration.boards import (
    Board,
    BoardKind,
    Ints,
    marker_corners,
    points_xy,
)
from ros_visualise.landmarks.tags.families import Family
from ros_visualise.landmarks.tags.finder import TagFinder

Markers = tuple[Ints, Floats]
"""Ids (M,), and corners (M, 4, 2) in pixels."""

FEWEST = 8
"""Smallest number of points of a view."""
_SEARCHED = 1280  # pixels of the longer side: larger images are reduced to find chessboards
_WINDOW_SHARE = 0.3  # half the window, as a fraction of the distance between corners
_FITTING = 0.6  # least fraction of the visible markers that must fit the board
_ASTRAY = 0.35  # largest offset of a marker, as a fraction of its side
_GAP_SHARE = 0.9  # fraction of the white gap around a marker, or of its black border
_HAMMING, _MARGIN = 1, 10.0  # loose, as the position of a marker is checked too
_NEAREST = 2  # least number of markers that predict a neighbour
_ONE_AT_A_TIME = Lock()
Bools = npt.NDArray[np.bool_]
_WINDOWS = (2, 20)
_MOVED = (1.5, 0.06)  # largest refinement: pixels, and fraction of a square
_CONTRAST = 20  # levels between black and white
_STOP = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)


class BoardPoints(NamedTuple):
    """Points of a board in an image.

    ``numbers`` are their indices in `points_xy`, ``uv`` (N, 2) pixels; ``fitting`` is the fraction
    of visible markers that fit this board.
    """

    numbers: Ints
    uv: Floats
    fitting: float = 1.0


def find_board(
    gray: Pixels, board: Board, thorough: bool = True, markers: Markers | None = None
) -> BoardPoints | None:
    """The board's points, at least `FEWEST`; None if it is not visible.

    Args:
        gray: (height, width) uint8.
        board: chessboards are found only as a whole, others also in part.
        thorough: also try a second, slower chessboard detector.
        markers: result of `find_markers`, if known.
    """
    if board.kind is BoardKind.CHESSBOARD:
        return _find_chessboard(gray, board, thorough)
    numbers, corners = find_markers(gray, board) if markers is None else markers
    known = numbers < len(marker_corners(board))
    numbers, corners = numbers[known], corners[known]
    fitting = _fitting(board, numbers, corners)
    if fitting.sum() < max(_FITTING * len(fitting), 1):
        return None
    take = _tag_corners if board.kind is BoardKind.APRILGRID else _charuco_corners
    found = take(gray, board, numbers[fitting], corners[fitting])
    is_enough = len(found.numbers) >= FEWEST and _is_wide(points_xy(board)[found.numbers], board)
    return found._replace(fitting=fitting.mean()) if is_enough else None


def find_markers(gray: Pixels, board: Board) -> Markers:
    """Ids (M,) and corners (M, 4, 2) of a board's markers, clockwise from the top left.

    Args:
        gray: (height, width) uint8.
        board: its dictionary and border are used.
    """
    with _ONE_AT_A_TIME:
        tags = _finder_of(board.dictionary, board.border).find(gray)
    numbers = np.array([tag.id for tag in tags], np.int64)
    corners = [tag.corners_uv[::-1] for tag in tags]  # were anticlockwise from the lower left
    return numbers, np.array(corners, np.float64).reshape(-1, 4, 2)


@lru_cache(maxsize=24)
def _finder_of(dictionary: str, border: int) -> TagFinder:
    name = f"DICT_{dictionary}"
    return TagFinder([Family(f"{name}, border of {border}", _HAMMING, _MARGIN, name, rim=border)])


def _is_wide(xy: Floats, board: Board) -> bool:
    """True if points (N, 2) on the board are not collinear (a line gives no pose)."""
    return bool(np.linalg.svd(xy - xy.mean(axis=0), compute_uv=False)[1] > board.square / 2)


def _find_chessboard(gray: Pixels, board: Board, thorough: bool) -> BoardPoints | None:
    size = (board.columns, board.rows)
    scale = min(1.0, _SEARCHED / max(gray.shape))
    small = (
        gray
        if scale == 1
        else cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    )
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_FAST_CHECK
    is_found, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not is_found and thorough:
        is_found, corners = cv2.findChessboardCornersSB(small, size)
    if not is_found:
        return None
    uv = (np.asarray(corners, np.float64).reshape(-1, 2) + 0.5) / scale - 0.5
    grid = uv.reshape(board.rows, board.columns, 2)
    sides = [np.linalg.norm(np.diff(grid, axis=axis), axis=2).min() for axis in (0, 1)]
    uv = refine(gray, uv, float(min(sides)) * _WINDOW_SHARE)
    is_seen = np.isfinite(uv[:, 0])
    return BoardPoints(np.flatnonzero(is_seen), uv[is_seen]) if is_seen.sum() >= FEWEST else None


def _fitting(board: Board, numbers: Ints, corners: Floats) -> Bools:
    """Mask of markers that fit the board, by a homography of most of them."""
    if len(numbers) < 2:  # a single one cannot be checked
        return np.zeros(len(numbers), bool)
    places = marker_corners(board)[numbers]
    sides = np.linalg.norm(np.diff(corners, axis=1), axis=2).mean(axis=1)
    limit = _ASTRAY * float(np.median(sides))
    H, _ = cv2.findHomography(places.reshape(-1, 2), corners.reshape(-1, 2), cv2.RANSAC, limit)
    if H is None:
        return np.zeros(len(numbers), bool)
    seen = cv2.perspectiveTransform(places.reshape(-1, 1, 2), H).reshape(-1, 4, 2)
    astray = np.linalg.norm(seen - corners, axis=2).max(axis=1)
    return np.asarray(astray < limit)


def _tag_corners(gray: Pixels, board: Board, numbers: Ints, corners: Floats) -> BoardPoints:
    """An AprilGrid's points: its tags' corners, where black squares touch them.

    Adjacent tags merge in the image, so many are not recognized. The others are searched beside
    those that were found, until no more turn up.
    """
    places = marker_corners(board)
    middles = places.mean(axis=1)
    reach = 1.5 * board.square * (1 + board.share)
    known = dict(zip(numbers.tolist(), corners, strict=True))
    found: dict[int, Floats] = {}
    waiting = [*known, *(tag for tag in range(len(places)) if tag not in known)]
    while waiting:
        later = []
        for tag in waiting:
            near = [one for one in known if np.abs(middles[one] - middles[tag]).max() < reach]
            if len(near) < _NEAREST:
                later.append(tag)
                continue
            uv = _tag_beside(gray, board, places[tag], places[near], [known[n] for n in near])
            kept = np.flatnonzero(np.isfinite(uv[:, 0]))
            found |= {4 * tag + int(corner): uv[corner] for corner in kept}
            if len(kept) == 4:
                known[tag] = uv
        if len(later) == len(waiting):
            break
        waiting = later
    return BoardPoints(np.array([*found], np.int64), np.array([*found.values()]).reshape(-1, 2))


def _tag_beside(
    gray: Pixels, board: Board, own: Floats, near: Floats, seen: Sequence[Floats]
) -> Floats:
    """Corners (4, 2) of a tag, NaN if not found.

    Args:
        own: (4, 2) on the board.
        near: (M, 4, 2) corners of the tags around it on the board.
        seen: pixels of these.
    """
    black = min(board.share, board.border / (6 + 2 * board.border))
    H, _ = cv2.findHomography(near.reshape(-1, 2), np.vstack(seen))
    if H is None:
        return np.full((4, 2), np.nan)
    start = to_pixels(own, H)
    side = float(np.linalg.norm(np.diff(start, axis=0), axis=1).min())
    uv = refine(gray, start, side * black * _GAP_SHARE)
    kept = are_in_place(uv, start, np.full(4, side)) & are_crossings(gray, own, H, black / 2)
    uv[~kept] = np.nan
    return uv


def _charuco_corners(gray: Pixels, board: Board, numbers: Ints, corners: Floats) -> BoardPoints:
    """Inner corners beside a visible marker, first predicted by the adjacent markers."""
    places = marker_corners(board)
    middles = places.mean(axis=1)[numbers]
    gap = (1 - board.share) / 2 * _GAP_SHARE
    found: dict[int, Floats] = {}
    for number, xy in enumerate(points_xy(board)):
        near = np.abs(middles - xy).max(axis=1) < 0.75 * board.square
        if not near.any():
            continue
        source, seen = places[numbers[near]].reshape(-1, 2), corners[near].reshape(-1, 2)
        H, _ = cv2.findHomography(source, seen)
        if H is None:
            continue
        around = xy + board.square * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        start, *others = to_pixels(around, H)
        side = np.linalg.norm(np.array(others) - start, axis=1).min()
        uv = refine(gray, start[None], float(side) * gap)
        if are_in_place(uv, start[None], np.array([side]))[0]:
            found[number] = uv[0]
    return BoardPoints(np.array([*found], np.int64), np.array([*found.values()]).reshape(-1, 2))


def refine(gray: Pixels, uv: Floats, half: float) -> Floats:
    """Refine corners (N, 2); NaN too near to the image border.

    Args:
        half: half the window, pixels.
    """
    window = int(np.clip(half, *_WINDOWS))
    found = np.full(uv.shape, np.nan)
    size = gray.shape[::-1]
    is_inside = ((uv > window) & (uv < np.subtract(size, 1 + window))).all(axis=1)
    if is_inside.any():
        start = uv[is_inside].astype(np.float32).reshape(-1, 1, 2)
        found[is_inside] = cv2.cornerSubPix(gray, start, (window,) * 2, (-1, -1), _STOP)[:, 0]
    return found


def are_in_place(uv: Floats, start: Floats, sides: Floats) -> Bools:
    """Mask of corners that stayed where they were seen; ``sides``: of their squares, pixels."""
    least, share = _MOVED
    reach = np.maximum(least, share * sides)
    return np.asarray(np.linalg.norm(uv - start, axis=1) <= reach)


def are_crossings(gray: Pixels, square: Floats, H: Any, share: float) -> Bools:
    """Mask of corners (4,) of a square that black and white surround as on a board.

    Args:
        square: (4, 2) on the board.
        H: homography from the board to pixels.
        share: distance from the corner to check, as a fraction of the square's side.
    """
    step = float(square[1, 0] - square[0, 0]) * share
    around = square[:, None] + step * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    seen = np.rint(to_pixels(around.reshape(-1, 2), H)).astype(int)
    u, v = (np.clip(seen[:, axis], 0, gray.shape[1 - axis] - 1) for axis in (0, 1))
    level = gray[v, u].reshape(4, 4).astype(int)
    inside = np.arange(4)
    dark = [level[inside, (inside + turn) % 4] for turn in (0, 2)]
    light = [level[inside, (inside + turn) % 4] for turn in (1, 3)]
    return np.asarray(np.minimum(*light) - np.maximum(*dark) > _CONTRAST)


def to_pixels(places: Floats, H: Any) -> Floats:
    """Points (N, 2) on the board mapped by a homography, pixels."""
    return np.asarray(cv2.perspectiveTransform(places[:, None], H), np.float64)[:, 0]
