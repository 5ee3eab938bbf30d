"""Finding a board whose description may be ambiguous."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import cv2

from ros_visualise.data import Pixels
from ros_visualise.landmarks.calibration.boards import (
    Board,
    BoardKind,
    dictionaries_of,
    points_xy,
    readings,
)
from ros_visualise.landmarks.calibration.finding import Markers, find_board, find_markers
from ros_visualise.landmarks.calibration.views import BoardView

_SURE = 3
_REDUCED = 960  # pixels of the longer side in which other dictionaries are searched


class BoardFinder:
    """Finds a board in images, and determines which interpretation of its description fits.

    All interpretations are tried until one was found three times; from then on, only that one.
    While none was found, other dictionaries are tried too, in the first image, the second, the
    fourth, the eighth and so on.

    Args:
        board: described by the user.
    """

    def __init__(self, board: Board) -> None:
        self.said = board
        self._readings = readings(board)
        self._found: Counter[Board] = Counter()
        self._seen = 0

    @property
    def board(self) -> Board | None:
        """The reading found most often; None before any was found."""
        return self._found.most_common(1)[0][0] if self._found else None

    @property
    def tried(self) -> str:
        """The boards searched for, in words."""
        first, *others = dict.fromkeys(one.counts for one in self._readings)
        tried = f"{self.said.noun} of {first}"
        tried += f", nor one of {' or '.join(others)}" if others else ""
        dictionaries = dictionaries_of(self.said)
        return tried + (f", with markers of {', '.join(dictionaries)}" if dictionaries else "")

    def look(self, gray: Pixels, name: str, thorough: bool = True) -> BoardView | None:
        """The board in an image.

        Args:
            gray: (height, width) uint8.
            name: of the image.
            thorough: see `find_board`.
        """
        self._seen += 1
        best = _find_best(gray, name, thorough, self._candidates())
        if best is None and not self._found and self._seen & (self._seen - 1) == 0:
            best = self._try_dictionaries(gray, name, thorough)
        if best is not None:
            self._found[best.board] += 1
        return best

    def _try_dictionaries(self, gray: Pixels, name: str, thorough: bool) -> BoardView | None:
        """The board with markers of another dictionary, searched in a smaller image."""
        scale = min(1.0, _REDUCED / max(gray.shape))
        small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        others = [replace(self.said, dictionary=one) for one in dictionaries_of(self.said)]
        boards = [board for one in others for board in readings(one)]
        seen = _find_best(small, name, thorough, boards)
        if seen is None:
            return None
        of_dictionary = readings(replace(self.said, dictionary=seen.board.dictionary))
        found = _find_best(gray, name, thorough, of_dictionary)
        self._readings = of_dictionary if found is not None else self._readings
        return found

    def _candidates(self) -> list[Board]:
        board = self.board
        is_sure = board is not None and self._found[board] >= _SURE
        return [board] if board is not None and is_sure else list(self._readings)


def _find_best(
    gray: Pixels, name: str, thorough: bool, boards: Iterable[Board]
) -> BoardView | None:
    """The board that an image shows best; None if it shows none of them."""
    size = (gray.shape[1], gray.shape[0])
    markers: dict[tuple[str, int], Markers] = {}  # readings of one board share them
    views = []
    for board in boards:
        kind = board.dictionary, board.border
        if board.kind is not BoardKind.CHESSBOARD and kind not in markers:
            markers[kind] = find_markers(gray, board)
        points = find_board(gray, board, thorough, markers.get(kind))
        if points is not None:
            views.append(BoardView(name, board, points, size))
    return max(views, key=_how_well, default=None)


def _how_well(view: BoardView) -> tuple[float, float, int]:
    """Sort key: markers are most reliable; with too many assumed rows, fewer are found.

    A small chessboard is also found inside a larger one, so for these the number of points decides.
    """
    count = len(view.points.numbers)
    is_whole = view.board.kind is BoardKind.CHESSBOARD
    share = 1.0 if is_whole else count / len(points_xy(view.board))
    return round(view.points.fitting, 2), share, count
