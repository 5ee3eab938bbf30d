"""Finding a board whose description may be ambiguous."""

from __future__ import annotations

from collections import Counter

from ros_visualise.data import Pixels
from ros_visualise.landmarks.calibration.boards import Board, BoardKind, points_xy, readings
from ros_visualise.landmarks.calibration.finding import Markers, find_board, find_markers
from ros_visualise.landmarks.calibration.views import BoardView

_SURE = 3


class BoardFinder:
    """Finds a board in images, and determines which interpretation of its description fits.

    All interpretations are tried until one was found three times; from then on, only that one.

    Args:
        board: described by the user.
    """

    def __init__(self, board: Board) -> None:
        self.said = board
        self._readings = readings(board)
        self._found: Counter[Board] = Counter()

    @property
    def board(self) -> Board | None:
        """The reading found most often; None before any was found."""
        return self._found.most_common(1)[0][0] if self._found else None

    @property
    def tried(self) -> str:
        """The boards searched for, in words."""
        first, *others = dict.fromkeys(one.counts for one in self._readings)
        return f"{self._readings[0].noun} of {first}" + (
            f", nor one of {' or '.join(others)}" if others else ""
        )

    def look(self, gray: Pixels, name: str, thorough: bool = True) -> BoardView | None:
        """The board in an image.

        Args:
            gray: (height, width) uint8.
            name: of the image.
            thorough: see `find_board`.
        """
        size = (gray.shape[1], gray.shape[0])
        seen = []
        markers: dict[int, Markers] = {}  # by border, the only difference between readings
        for board in self._candidates():
            if board.kind is not BoardKind.CHESSBOARD and board.border not in markers:
                markers[board.border] = find_markers(gray, board)
            seen.append((board, find_board(gray, board, thorough, markers.get(board.border))))
        views = [
            BoardView(name, board, points, size) for board, points in seen if points is not None
        ]
        best = max(views, key=_how_well, default=None)
        if best is not None:
            self._found[best.board] += 1
        return best

    def _candidates(self) -> list[Board]:
        board = self.board
        is_sure = board is not None and self._found[board] >= _SURE
        return [board] if board is not None and is_sure else list(self._readings)


def _how_well(view: BoardView) -> tuple[float, float, int]:
    """Sort key: markers are most reliable; with too many assumed rows, fewer are found.

    A small chessboard is also found inside a larger one, so for these the number of points decides.
    """
    count = len(view.points.numbers)
    is_whole = view.board.kind is BoardKind.CHESSBOARD
    share = 1.0 if is_whole else count / len(points_xy(view.board))
    return round(view.points.fitting, 2), share, count
